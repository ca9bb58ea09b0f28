//! The state that decides what a core does next: two equal states mean that a loop changes nothing.

use crate::bus::Cycle;
use crate::cpu::Cpu;

/// Everything except time, memory, waiting interrupts, and the system registers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoreState {
    registers: [u32; 16],
    pc: u32,
    other_stack: u32,
    status: u32,
    masks: (bool, bool, u8),
    control: [bool; 3],
    float: [u32; 32],
    fpscr: u32,
    exclusive: bool,
    event: bool,
    /// Whether the next load is pipelined with the last one.
    loaded: bool,
}

impl CoreState {
    /// The address of the next instruction.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.pc
    }
}

impl Cpu {
    /// The present state.
    #[must_use]
    pub fn state(&self) -> CoreState {
        CoreState {
            registers: self.r,
            pc: self.pc,
            other_stack: self.other_stack,
            status: self.xpsr(),
            masks: (self.primask, self.faultmask, self.basepri),
            control: [self.unprivileged, self.process_stack, self.float_active],
            float: self.s,
            fpscr: self.fpscr,
            exclusive: self.exclusive,
            event: self.event,
            loaded: self.loaded,
        }
    }

    /// Lets time pass for whole iterations of a loop that changes nothing. No event may be due before their end.
    pub fn pass_turns(&mut self, cycles: Cycle, instructions: u64) {
        self.now += cycles;
        self.instructions += instructions;
    }

    /// The cycle at which the core's own timer next changes.
    #[must_use]
    pub fn next_event(&self) -> Cycle {
        self.systick.next_event()
    }
}
