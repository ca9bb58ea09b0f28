//! Why a machine stopped, with messages.

use std::fmt;

use crate::flash::FlashOperation;
use crate::time::Picoseconds;
use crate::trouble::Trouble;

/// Why [`Machine::run_until`](crate::Machine::run_until) returned.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Halt {
    /// The time asked for is reached.
    Reached,
    /// Firmware executed a breakpoint instruction with this number.
    Breakpoint {
        /// The number of the breakpoint.
        number: u8,
        /// The place in the program.
        place: Place,
    },
    /// Firmware made a semihosting call.
    Semihosting {
        /// The place in the program.
        place: Place,
    },
    /// A fault within a fault handler: the core is locked up until a reset.
    Lockup {
        /// The place in the program.
        place: Place,
    },
    /// The firmware did something that the model does not implement.
    Trouble {
        /// The forbidden action of the program.
        trouble: Trouble,
        /// The place in the program; the instruction before it was the cause.
        place: Place,
    },
    /// Power was cut.
    PowerLost {
        /// The place in the program.
        place: Place,
    },
    /// The flash begins an operation.
    FlashOperation(FlashOperation),
    /// A reason of the core that this version does not know.
    Other(String),
}

/// Place and time at which the core stopped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Program counter.
    pub pc: u32,
    /// The function, where the ELF names it.
    pub symbol: Option<String>,
    /// Time since power-on.
    pub time: Picoseconds,
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "at {:#010x}", self.pc)?;
        if let Some(symbol) = &self.symbol {
            write!(formatter, " in {symbol}")?;
        }
        let micros = self.time.0 / 1_000_000;
        write!(formatter, ", {}.{:06} s after power-on", micros / 1_000_000, micros % 1_000_000)
    }
}

impl fmt::Display for Halt {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reached => formatter.write_str("the time asked for has come"),
            Self::Breakpoint { number, place } => write!(formatter, "breakpoint {number} {place}"),
            Self::Semihosting { place } => write!(formatter, "semihosting call {place}"),
            Self::Lockup { place } => write!(formatter, "lockup: a fault within a fault handler, {place}"),
            Self::Trouble { trouble, place } => write!(formatter, "{trouble}; {place}"),
            Self::PowerLost { place } => write!(formatter, "power was cut {place}"),
            Self::FlashOperation(operation) => write!(formatter, "the flash begins {operation:?}"),
            Self::Other(what) => formatter.write_str(what),
        }
    }
}
