//! The interface between the chip and its peripherals.

use vergence_cpu::{Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::time::Picoseconds;

/// The present cycle, with the clocks that give its real time.
#[derive(Clone, Copy)]
pub(crate) struct Moment<'a> {
    pub now: Cycle,
    pub clocks: &'a Clocks,
}

impl Moment<'_> {
    pub fn time(&self) -> Picoseconds {
        self.clocks.base.time_of(self.now)
    }
}

/// An access to a register that the model does not implement; a few words for the report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refused(pub String);

impl From<&str> for Refused {
    fn from(words: &str) -> Self {
        Self(words.to_owned())
    }
}

/// The answer of a register.
pub(crate) type Reply<T> = Result<T, Refused>;

/// Refuses `value` where it has bits outside `known`.
pub(crate) fn only(value: u32, known: u32) -> Reply<()> {
    let unknown = value & !known;
    if unknown == 0 { Ok(()) } else { Err(Refused(format!("bits {unknown:#x} are not modelled"))) }
}

/// Offsets and names of the registers that a model has; anything else is refused before it gets there.
pub(crate) type Registers = &'static [(u32, &'static str)];

/// A peripheral: a block of registers whose state changes with time.
///
/// The chip calls [`advance`](Self::advance) before each access, and no later than [`due`](Self::due).
pub(crate) trait Peripheral {
    fn registers(&self) -> Registers;

    /// Reads the register at `offset`, a multiple of four.
    fn read(&mut self, moment: Moment, offset: u32) -> Reply<u32>;

    /// Whether a read of the register at `offset` has no side effect, so that nothing need be checked after it.
    fn reads_quietly(&self, _offset: u32) -> bool {
        false
    }

    /// Writes the register at `offset`, a multiple of four; narrow writes come zero-extended.
    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()>;

    /// Advances the state to `moment`.
    fn advance(&mut self, _moment: Moment) {}

    /// The cycle of the next own change that could be observed.
    fn due(&self, _clocks: &Clocks) -> Cycle {
        NEVER
    }

    /// Interrupt lines that are asserted.
    fn lines(&self) -> Lines {
        0
    }
}
