//! TMC2209 motor drivers on one serial line: what is said on the line, their settings, and the supervisor that gives them
//! these settings and watches them.
//!
//! - `datagram`: bytes of writes, requests and replies
//! - `registers`: registers, their bits, and the values that settings become
//! - `settings`: settings of one driver
//! - `channel`: one driver, from the first question on
//! - `line`: all drivers of a line, one exchange at a time

mod channel;
mod datagram;
mod line;
mod registers;
mod settings;

pub use datagram::{ADDRESSES, Datagram, LONGEST, request, value_of, write};
pub use line::DriverLine;
pub use registers::Register;
pub(crate) use settings::LEAST_FULL_STEPS;
pub use settings::{DriverKind, DriverSettings, StallLimits};
