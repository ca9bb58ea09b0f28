//! The private peripheral bus (B3.1): system control space, DWT and the identification of what is absent.

use crate::bus::{Access, Bus, BusFault};
use crate::cpu::{Cpu, Stop};
use crate::nvic::exception;
use crate::system::{configuration, context, sleep};

/// CPUID of Cortex-M4 r0p1.
const IDENTITY: u32 = 0x410f_c241;
const DWT_CONTROL: u32 = 0xe000_1000;
const DWT_CYCLES: u32 = 0xe000_1004;
const INTERRUPT_TYPE: u32 = 0xe000_e004;
const AUXILIARY_CONTROL: u32 = 0xe000_e008;
const SYSTICK: u32 = 0xe000_e010;
const SYSTICK_END: u32 = 0xe000_e01f;
const PRIORITIES: u32 = 0xe000_e400;
const PRIORITIES_END: u32 = 0xe000_e47f;
const INTERRUPT_CONTROL: u32 = 0xe000_ed04;
const RESET_CONTROL: u32 = 0xe000_ed0c;
const SYSTEM_PRIORITIES: u32 = 0xe000_ed18;
const SYSTEM_PRIORITIES_END: u32 = 0xe000_ed23;
const HANDLER_CONTROL: u32 = 0xe000_ed24;
const FAULT_STATUS: u32 = 0xe000_ed28;
const DEBUG_CONTROL: u32 = 0xe000_edfc;
const SOFTWARE_TRIGGER: u32 = 0xe000_ef00;
/// The key that every write to AIRCR needs in its upper half, and the value that this half reads as.
const KEY: u32 = 0x05fa;
const KEY_READ: u32 = 0xfa05;

impl Cpu {
    /// Reads a register of the core. A narrow access reads part of the word.
    #[cold]
    pub(crate) fn read_private<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access) -> Result<u32, BusFault> {
        if !self.privileged() {
            return Err(BusFault);
        }
        self.horizon = 0;
        self.synchronize(bus);
        let word = self.read_register(address & !3);
        let word = word >> (8 * (address & 3));
        Ok(match access {
            Access::Byte => word & 0xff,
            Access::Half => word & 0xffff,
            Access::Word => word,
        })
    }

    /// Writes a register of the core. The bytes beside a narrow write keep their value; for registers that act on ones
    /// they count as zero.
    #[cold]
    pub(crate) fn write_private<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        access: Access,
        value: u32,
    ) -> Result<(), BusFault> {
        let trigger = address == SOFTWARE_TRIGGER && self.system.configuration & configuration::USER_TRIGGER != 0;
        if !self.privileged() && !trigger {
            return Err(BusFault);
        }
        self.horizon = 0;
        self.synchronize(bus);
        let shift = 8 * (address & 3);
        let mask = match access {
            Access::Byte => 0xff,
            Access::Half => 0xffff,
            Access::Word => u32::MAX,
        } << shift;
        let register = address & !3;
        let others = if mask == u32::MAX || acts_on_ones(register) { 0 } else { self.read_register(register) & !mask };
        self.write_register(register, others | value << shift & mask);
        Ok(())
    }

    fn read_register(&mut self, address: u32) -> u32 {
        let system = &self.system;
        match address {
            // CYCCNT only: no profiling counters, no comparators.
            DWT_CONTROL => 0x0f00_0000 | system.trace_control,
            DWT_CYCLES => system.cycle_counter(self.now),
            INTERRUPT_TYPE => 3,
            AUXILIARY_CONTROL => system.auxiliary_control,
            SYSTICK..=SYSTICK_END => {
                if self.systick.advance(self.now) {
                    self.nvic.raise(exception::SYSTEM_TICK);
                }
                self.systick.read(address - SYSTICK)
            }
            0xe000_e100..=0xe000_e10f | 0xe000_e180..=0xe000_e18f => lines_word(self.nvic.enabled, address),
            0xe000_e200..=0xe000_e20f | 0xe000_e280..=0xe000_e28f => lines_word(self.nvic.pending, address),
            0xe000_e300..=0xe000_e30f => lines_word(self.nvic.active, address),
            PRIORITIES..=PRIORITIES_END => self.priorities((address - PRIORITIES) as u16 + exception::FIRST_LINE),
            SYSTEM_PRIORITIES..=SYSTEM_PRIORITIES_END => self.priorities((address - SYSTEM_PRIORITIES) as u16 + 4),
            0xe000_ed00 => IDENTITY,
            INTERRUPT_CONTROL => self.interrupt_control(),
            0xe000_ed08 => system.vector_table,
            RESET_CONTROL => KEY_READ << 16 | self.nvic.grouping << 8,
            0xe000_ed10 => system.sleep,
            0xe000_ed14 => system.configuration,
            HANDLER_CONTROL => self.handler_control(),
            FAULT_STATUS => system.fault_status,
            0xe000_ed2c => system.hard_fault_status,
            0xe000_ed30 => system.debug_fault_status,
            0xe000_ed34 => system.memory_fault_address,
            0xe000_ed38 => system.bus_fault_address,
            0xe000_ed40..=0xe000_ed7f => feature(address),
            0xe000_ed88 => system.coprocessor_access,
            DEBUG_CONTROL => system.debug_control,
            0xe000_ef34 => system.float_context,
            0xe000_ef38 => system.float_address,
            0xe000_ef3c => system.float_defaults,
            0xe000_ef40 => 0x1011_0021,
            0xe000_ef44 => 0x1100_0011,
            // MPU_TYPE among them: no regions.
            _ => 0,
        }
    }

    fn write_register(&mut self, address: u32, value: u32) {
        let now = self.now;
        match address {
            DWT_CONTROL => self.system.change_counting(now, |system| system.trace_control = value & 1),
            DWT_CYCLES => self.system.set_cycle_counter(now, value),
            AUXILIARY_CONTROL => self.system.auxiliary_control = value & 0x307,
            SYSTICK..=SYSTICK_END => {
                if self.systick.advance(now) {
                    self.nvic.raise(exception::SYSTEM_TICK);
                }
                self.systick.write(address - SYSTICK, value);
            }
            0xe000_e100..=0xe000_e10f => self.nvic.enabled |= lines_bits(address, value),
            0xe000_e180..=0xe000_e18f => self.nvic.enabled &= !lines_bits(address, value),
            0xe000_e200..=0xe000_e20f => self.pend_lines(lines_bits(address, value)),
            0xe000_e280..=0xe000_e28f => self.nvic.pending &= !lines_bits(address, value),
            PRIORITIES..=PRIORITIES_END => {
                self.set_priorities((address - PRIORITIES) as u16 + exception::FIRST_LINE, value);
            }
            SYSTEM_PRIORITIES..=SYSTEM_PRIORITIES_END => {
                self.set_priorities((address - SYSTEM_PRIORITIES) as u16 + 4, value);
            }
            SOFTWARE_TRIGGER => self.pend_lines(1 << (value & 0x7f)),
            0xe000_ed00..=0xe000_ed8b => self.write_system_control(address, value),
            DEBUG_CONTROL => self.system.change_counting(now, |system| system.debug_control = value & 0x010f_07f1),
            0xe000_ef34 => {
                self.system.float_context = value & (context::WRITABLE | 0x17b);
                self.float_ready = false;
            }
            0xe000_ef38 => self.system.float_address = value & !7,
            0xe000_ef3c => self.system.float_defaults = value & 0x07c0_0000,
            _ => {}
        }
    }

    fn write_system_control(&mut self, address: u32, value: u32) {
        match address {
            INTERRUPT_CONTROL => self.set_interrupt_control(value),
            0xe000_ed08 => self.system.vector_table = value & 0xffff_ff80,
            RESET_CONTROL if value >> 16 == KEY => self.set_reset_control(value),
            0xe000_ed10 => self.system.sleep = value & sleep::WRITABLE,
            0xe000_ed14 => self.system.configuration = value & configuration::WRITABLE,
            HANDLER_CONTROL => self.set_handler_control(value),
            FAULT_STATUS => self.system.fault_status &= !value,
            0xe000_ed2c => self.system.hard_fault_status &= !value,
            0xe000_ed30 => self.system.debug_fault_status &= !value,
            0xe000_ed34 => self.system.memory_fault_address = value,
            0xe000_ed38 => self.system.bus_fault_address = value,
            0xe000_ed88 => {
                self.system.coprocessor_access = value & 0x00f0_0000;
                self.float_ready = false;
            }
            _ => {}
        }
    }

    fn pend_lines(&mut self, lines: u128) {
        let fresh = lines & !self.nvic.pending;
        self.nvic.pending |= lines;
        if fresh != 0 {
            self.pended();
        }
    }

    fn priorities(&self, first: u16) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|index| self.nvic.priority_byte(first + index)))
    }

    fn set_priorities(&mut self, first: u16, value: u32) {
        for (number, byte) in (first..).zip(value.to_le_bytes()) {
            self.nvic.set_priority_byte(number, byte);
        }
    }

    /// ICSR (B3.2.4). VECTPENDING leaves out exceptions that BASEPRI or FAULTMASK mask, but not those that PRIMASK
    /// masks.
    fn interrupt_control(&self) -> u32 {
        let flag = |set: bool, bit: u32| u32::from(set) << bit;
        let unmasked = |&number: &u16| self.nvic.priority(number) < self.mask_priority();
        let pending = u32::from(self.nvic.best_pending().filter(unmasked).unwrap_or(0));
        flag(self.nvic.is_pending(exception::NMI), 31)
            | flag(self.nvic.is_pending(exception::PENDABLE), 28)
            | flag(self.nvic.is_pending(exception::SYSTEM_TICK), 26)
            | flag(self.nvic.any_line_pending(), 22)
            | pending << 12
            | flag(self.nvic.active_count() <= 1, 11)
            | u32::from(self.exception)
    }

    fn set_interrupt_control(&mut self, value: u32) {
        let bit = |index: u32| value >> index & 1 != 0;
        for (number, set, clear) in [(exception::PENDABLE, 28, 27), (exception::SYSTEM_TICK, 26, 25)] {
            if bit(clear) {
                self.nvic.clear_pending(number);
            } else if bit(set) && !self.nvic.is_pending(number) {
                self.nvic.raise(number);
                self.pended();
            }
        }
        if bit(31) {
            self.nvic.raise(exception::NMI);
        }
    }

    /// AIRCR (B3.2.6).
    fn set_reset_control(&mut self, value: u32) {
        self.nvic.grouping = value >> 8 & 7;
        if value & 4 != 0 {
            self.halt(Stop::ResetRequested);
        }
    }

    /// SHCSR (B3.2.13): exceptions with their active and pending bits.
    fn handler_control(&self) -> u32 {
        let mut value = self.system.faults_enabled;
        for (number, bit) in HANDLER_ACTIVE {
            value |= u32::from(self.nvic.is_active(number)) << bit;
        }
        for (number, bit) in HANDLER_PENDING {
            value |= u32::from(self.nvic.is_pending(number)) << bit;
        }
        value
    }

    fn set_handler_control(&mut self, value: u32) {
        self.system.faults_enabled = value & 0x0007_0000;
        for (number, bit) in HANDLER_ACTIVE {
            let mask = 1 << number;
            self.nvic.system_active = self.nvic.system_active & !mask | ((value >> bit & 1) as u16) << number;
        }
        for (number, bit) in HANDLER_PENDING {
            let mask = 1 << number;
            self.nvic.system_pending = self.nvic.system_pending & !mask | ((value >> bit & 1) as u16) << number;
        }
    }
}

/// Registers whose zero bits change nothing.
const fn acts_on_ones(address: u32) -> bool {
    matches!(
        address,
        0xe000_e100..=0xe000_e2ff | INTERRUPT_CONTROL | RESET_CONTROL | FAULT_STATUS..=0xe000_ed30 | SOFTWARE_TRIGGER
    )
}

/// Exception number and bit of SHCSR.
const HANDLER_ACTIVE: [(u16, u32); 7] = [(4, 0), (5, 1), (6, 3), (11, 7), (12, 8), (14, 10), (15, 11)];
const HANDLER_PENDING: [(u16, u32); 4] = [(6, 12), (4, 13), (5, 14), (11, 15)];

/// The word of a set of lines that the register at `address` shows.
fn lines_word(lines: u128, address: u32) -> u32 {
    (lines >> (8 * (address & 0xc))) as u32
}

fn lines_bits(address: u32, value: u32) -> u128 {
    u128::from(value) << (8 * (address & 0xc))
}

/// Feature registers of the Cortex-M4 (TRM table 4-1).
const fn feature(address: u32) -> u32 {
    match address {
        0xe000_ed40 => 0x30,
        0xe000_ed44 => 0x200,
        0xe000_ed48 => 0x0010_0000,
        0xe000_ed50 => 0x0010_0030,
        0xe000_ed58 => 0x0100_0000,
        0xe000_ed60 => 0x0110_1110,
        0xe000_ed64 => 0x0211_2000,
        0xe000_ed68 => 0x2123_2231,
        0xe000_ed6c => 0x0111_1131,
        0xe000_ed70 => 0x0131_0132,
        _ => 0,
    }
}
