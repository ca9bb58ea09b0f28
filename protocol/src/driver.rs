//! What the board knows of the motor driver of an axis.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::FaultCode;

/// State of the motor driver of an axis. Append only: the order is the wire format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum DriverState {
    /// The driver has step and direction inputs only: the board knows nothing of it.
    #[default]
    Plain,
    /// The driver has not yet got its settings from the board, or the board has not read them back.
    Starting,
    /// The driver has its settings and works.
    Ready,
    /// The driver works, and warns that it is hot.
    Hot,
    /// The driver cannot be used, for this reason. The board tries again by itself.
    Failed(FaultCode),
}

impl DriverState {
    /// Whether the axis may be moved.
    #[must_use]
    pub const fn is_usable(self) -> bool {
        matches!(self, Self::Plain | Self::Ready | Self::Hot)
    }
}

impl fmt::Display for DriverState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain => f.write_str("step and direction only"),
            Self::Starting => f.write_str("getting its settings"),
            Self::Ready => f.write_str("ready"),
            Self::Hot => f.write_str("ready, but hot"),
            Self::Failed(code) => write!(f, "not usable: {code}"),
        }
    }
}
