//! Program status, special registers and the two stack pointers (B1.4), and the registers as tests and traces see them.

use crate::cpu::Cpu;
use crate::nvic::{HARD_FAULT_PRIORITY, PRIORITY_BITS};

const N: u32 = 1 << 31;
const Z: u32 = 1 << 30;
const C: u32 = 1 << 29;
const V: u32 = 1 << 28;
const Q: u32 = 1 << 27;
const T: u32 = 1 << 24;

/// Bits of FPSCR that exist on this core.
const FPSCR_WRITABLE: u32 = 0xf7c0_009f;

impl Cpu {
    /// Core register 0 to 12, 13 (SP), 14 (LR) or 15 (the address of the next instruction).
    #[must_use]
    pub fn register(&self, number: usize) -> u32 {
        if number & 15 == 15 { self.pc } else { self.r[number & 15] }
    }

    /// Sets what [`register`](Self::register) reads.
    pub fn set_register(&mut self, number: usize, value: u32) {
        match number & 15 {
            15 => {
                self.pc = value & !1;
                self.it = 0;
            }
            13 => self.r[13] = value & !3,
            number => self.r[number] = value,
        }
    }

    /// Single-precision register 0 to 31 as its bits.
    #[must_use]
    pub fn float_register(&self, number: usize) -> u32 {
        self.s[number & 31]
    }

    /// The address of the next instruction.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.pc
    }

    /// The number of the exception that runs, 0 in thread mode.
    #[must_use]
    pub fn exception(&self) -> u16 {
        self.exception
    }

    /// FPSCR.
    #[must_use]
    pub fn fpscr(&self) -> u32 {
        self.fpscr
    }

    /// APSR, IPSR and EPSR in one word (B1.4.2).
    #[must_use]
    pub fn xpsr(&self) -> u32 {
        let it = u32::from(self.it);
        self.apsr() | (it & 3) << 25 | if self.thumb { T } else { 0 } | (it >> 2) << 10 | u32::from(self.exception)
    }

    pub(crate) fn set_xpsr(&mut self, value: u32) {
        self.set_flags(value);
        self.set_ge(value);
        self.it = (value >> 25 & 3 | value >> 8 & 0xfc) as u8;
        self.thumb = value & T != 0;
        self.exception = (value & 0x1ff) as u16;
    }

    fn apsr(&self) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        flag(self.n, N)
            | flag(self.z, Z)
            | flag(self.c, C)
            | flag(self.v, V)
            | flag(self.q, Q)
            | u32::from(self.ge) << 16
    }

    fn set_flags(&mut self, value: u32) {
        self.set_condition_flags(value);
        self.q = value & Q != 0;
    }

    /// N, Z, C and V from the top bits of a status word.
    pub(crate) fn set_condition_flags(&mut self, value: u32) {
        self.n = value & N != 0;
        self.z = value & Z != 0;
        self.c = value & C != 0;
        self.v = value & V != 0;
    }

    fn set_ge(&mut self, value: u32) {
        self.ge = (value >> 16 & 15) as u8;
    }

    /// Whether R13 is the process stack pointer now.
    pub(crate) fn uses_process_stack(&self) -> bool {
        self.process_stack && self.exception == 0
    }

    /// Changes mode or stack selection, and R13 with it.
    pub(crate) fn select_stack(&mut self, change: impl FnOnce(&mut Self)) {
        let before = self.uses_process_stack();
        change(self);
        if self.uses_process_stack() != before {
            std::mem::swap(&mut self.r[13], &mut self.other_stack);
        }
    }

    pub(crate) fn privileged(&self) -> bool {
        self.exception != 0 || !self.unprivileged
    }

    fn stack_pointer(&mut self, process: bool) -> &mut u32 {
        if process == self.uses_process_stack() { &mut self.r[13] } else { &mut self.other_stack }
    }

    fn control(&self) -> u32 {
        u32::from(self.unprivileged) | u32::from(self.process_stack) << 1 | u32::from(self.float_active) << 2
    }

    fn set_control(&mut self, value: u32) {
        self.unprivileged = value & 1 != 0;
        self.float_active = value & 4 != 0;
        self.float_ready = false;
        if self.exception == 0 {
            self.select_stack(|cpu| cpu.process_stack = value & 2 != 0);
        }
    }

    /// MRS (B5.2.2).
    pub(crate) fn read_special(&mut self, number: u32) -> u32 {
        match number {
            0..=7 => {
                let exception = if number & 1 != 0 { u32::from(self.exception) } else { 0 };
                exception | if number & 4 == 0 { self.apsr() } else { 0 }
            }
            20 => self.control(),
            _ if !self.privileged() => 0,
            8 | 9 => *self.stack_pointer(number == 9),
            16 => u32::from(self.primask),
            17 | 18 => u32::from(self.basepri),
            19 => u32::from(self.faultmask),
            _ => 0,
        }
    }

    /// MSR (B5.2.3); `mask` selects the flags (bit 1) and GE (bit 0) of APSR.
    pub(crate) fn write_special(&mut self, number: u32, mask: u8, value: u32) {
        if number < 4 {
            if mask & 2 != 0 {
                self.set_flags(value);
            }
            if mask & 1 != 0 {
                self.set_ge(value);
            }
        } else if self.privileged() {
            self.write_privileged(number, value);
            self.horizon = 0;
        }
    }

    fn write_privileged(&mut self, number: u32, value: u32) {
        let priority = value as u8 & PRIORITY_BITS;
        match number {
            8 | 9 => *self.stack_pointer(number == 9) = value & !3,
            16 => self.primask = value & 1 != 0,
            17 => self.basepri = priority,
            18 if priority != 0 && (self.basepri == 0 || priority < self.basepri) => self.basepri = priority,
            19 => self.set_faultmask(value & 1 != 0),
            20 => self.set_control(value),
            _ => {}
        }
    }

    /// FAULTMASK cannot be set by code that already runs at its priority (B5.2.3).
    pub(crate) fn set_faultmask(&mut self, mask: bool) {
        if !mask || self.execution_priority() > HARD_FAULT_PRIORITY {
            self.faultmask = mask;
        }
    }

    pub(crate) fn set_fpscr(&mut self, value: u32) {
        self.fpscr = value & FPSCR_WRITABLE;
    }
}
