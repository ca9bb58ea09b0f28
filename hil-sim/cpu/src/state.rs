//! What a core is about to do: for loops that come round to where they were.

use crate::bus::Cycle;
use crate::cpu::Cpu;

/// Everything but time, memory, interrupts that wait, and the system's registers.
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
    /// The next load is pipelined with the last one.
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
    /// What the core is about to do.
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

    /// Lets time pass in which the core goes round a loop that changes nothing; whole turns, and nothing may be due
    /// before their end.
    pub fn pass_turns(&mut self, cycles: Cycle, instructions: u64) {
        self.now += cycles;
        self.instructions += instructions;
    }

    /// When the core's own timer next does something.
    #[must_use]
    pub fn next_event(&self) -> Cycle {
        self.systick.next_event()
    }
}
