//! Why a machine stands still, in words.

use std::fmt;

use crate::flash::FlashOperation;
use crate::time::Picoseconds;
use crate::trouble::Trouble;

/// Why [`Machine::run_until`](crate::Machine::run_until) came back.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Halt {
    /// The time asked for has come.
    Reached,
    /// Firmware executed a breakpoint instruction with this number.
    Breakpoint {
        /// The number.
        number: u8,
        /// Where.
        place: Place,
    },
    /// Firmware made a semihosting call.
    Semihosting {
        /// Where.
        place: Place,
    },
    /// A fault within a fault handler: the core stands until a reset.
    Lockup {
        /// Where.
        place: Place,
    },
    /// Firmware did something that the model does not do.
    Trouble {
        /// What.
        trouble: Trouble,
        /// Where; the instruction before did it.
        place: Place,
    },
    /// Power was cut.
    PowerLost {
        /// Where.
        place: Place,
    },
    /// The flash begins an operation.
    FlashOperation(FlashOperation),
    /// Something that this version does not know.
    Other(String),
}

/// Where and when the core stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Program counter.
    pub pc: u32,
    /// The function, where the ELF names it.
    pub symbol: Option<String>,
    /// When.
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
