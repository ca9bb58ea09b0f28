//! What every peripheral is to the chip.

use vergence_cpu::{Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::time::Picoseconds;

/// Now, by both clocks.
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

/// What firmware asked of a register and the model does not do; a few words for the report.
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

/// A block of registers with a life of its own.
///
/// The chip calls [`advance`](Self::advance) before each access, and no later than [`due`](Self::due).
pub(crate) trait Peripheral {
    fn registers(&self) -> Registers;

    /// Reads the register at `offset`, a multiple of four.
    fn read(&mut self, moment: Moment, offset: u32) -> Reply<u32>;

    /// Whether a read of the register at `offset` leaves everything as it is, so that nobody need look anew.
    fn reads_quietly(&self, _offset: u32) -> bool {
        false
    }

    /// Writes the register at `offset`, a multiple of four; narrow writes come zero-extended.
    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()>;

    /// Brings the state to `moment`.
    fn advance(&mut self, _moment: Moment) {}

    /// When something next happens by itself that somebody could notice.
    fn due(&self, _clocks: &Clocks) -> Cycle {
        NEVER
    }

    /// Interrupt lines that are asserted.
    fn lines(&self) -> Lines {
        0
    }
}
