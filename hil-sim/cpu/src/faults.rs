//! What interrupts an instruction, and how faults become exceptions (B1.5.11, B1.5.14).

use crate::bus::Bus;
use crate::cpu::{Cpu, Stop};
use crate::execute::Trap;
use crate::nvic::{HARD_FAULT_PRIORITY, exception};
use crate::system::status;

/// The number that makes a breakpoint a semihosting call.
const SEMIHOSTING: u8 = 0xab;

impl Trap {
    /// Whether the return address is the instruction itself, so that it runs again.
    pub(crate) fn repeats(self) -> bool {
        !matches!(self, Self::SupervisorCall | Self::Return(_) | Self::Breakpoint(SEMIHOSTING))
    }

    /// Exception and status bit of a fault.
    fn fault(self) -> Option<(u16, u32)> {
        Some(match self {
            Self::Undefined => (exception::USAGE, status::UNDEFINED),
            Self::NoCoprocessor => (exception::USAGE, status::NO_COPROCESSOR),
            Self::InvalidState => (exception::USAGE, status::INVALID_STATE),
            Self::Unaligned => (exception::USAGE, status::UNALIGNED),
            Self::DivideByZero => (exception::USAGE, status::DIVIDE_BY_ZERO),
            Self::Bus(_) => (exception::BUS, status::PRECISE | status::BUS_ADDRESS_VALID),
            Self::InstructionBus => (exception::BUS, status::INSTRUCTION_BUS),
            Self::LazyFloat => (exception::BUS, status::LAZY_FLOAT),
            Self::ExecuteNever => (exception::MEMORY, status::INSTRUCTION_ACCESS),
            Self::SupervisorCall | Self::Breakpoint(_) | Self::Return(_) => return None,
        })
    }
}

impl Cpu {
    /// Handles an instruction that ended in a fault, a call or a breakpoint.
    #[cold]
    pub(crate) fn trapped<B: Bus>(&mut self, bus: &mut B, trap: Trap) {
        self.horizon = 0;
        self.loaded = false;
        if trap.repeats() {
            self.pc = self.r[15].wrapping_sub(4);
        }
        match trap {
            Trap::Return(value) => self.exception_return(bus, value),
            Trap::Breakpoint(SEMIHOSTING) => self.stop = Some(Stop::Semihosting),
            Trap::Breakpoint(number) => self.stop = Some(Stop::Breakpoint(number)),
            Trap::SupervisorCall => self.raise_now(exception::SUPERVISOR_CALL),
            Trap::Bus(address) => {
                self.system.bus_fault_address = address;
                self.raise_fault(trap);
            }
            _ => self.raise_fault(trap),
        }
    }

    fn raise_fault(&mut self, trap: Trap) {
        if let Some((number, bit)) = trap.fault() {
            self.system.fault_status |= bit;
            self.raise_now(number);
        }
    }

    /// Pends an exception that cannot wait: one that is disabled, or may not preempt, becomes a HardFault; where that
    /// may not preempt either the core locks up.
    pub(crate) fn raise_now(&mut self, number: u16) {
        let enabled = match number {
            exception::MEMORY..=exception::USAGE => self.system.faults_enabled >> (number + 12) & 1 != 0,
            _ => true,
        };
        let current = self.execution_priority();
        if enabled && self.nvic.priority(number) < current {
            self.nvic.raise(number);
        } else if current > HARD_FAULT_PRIORITY {
            self.system.hard_fault_status |= status::FORCED;
            self.nvic.raise(exception::HARD_FAULT);
        } else {
            self.halt(Stop::Lockup);
        }
    }

    /// What a BKPT does on a chip with no debugger: a HardFault (C1.6.3). Call it after [`Stop::Breakpoint`].
    pub fn escalate_breakpoint(&mut self) {
        if self.execution_priority() > HARD_FAULT_PRIORITY {
            self.system.hard_fault_status |= status::DEBUG_EVENT;
            self.nvic.raise(exception::HARD_FAULT);
        } else {
            self.halt(Stop::Lockup);
        }
    }
}
