//! What the board knows of the encoder of an axis beyond its count.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::FaultCode;

/// State of the encoder of an axis. Append only: the order is the wire format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum EncoderState {
    /// The encoder has two lines only: the board knows nothing of it but its count.
    #[default]
    Plain,
    /// The encoder has an index, at which its count is checked.
    Indexed {
        /// Index pulses passed since the axis got its reference.
        passes: u32,
        /// Drift at the latest pulse against the first one, in counts.
        drift: i32,
        /// Largest drift since the axis got its reference, in counts, with its sign.
        worst: i32,
    },
    /// An absolute encoder that has not answered yet.
    Starting,
    /// An absolute encoder that works.
    Absolute {
        /// Its reading, in counts within its turn.
        reading: u16,
        /// Gain with which it reads its magnet: 0 for a strong field, 255 for a weak one.
        gain: u8,
    },
    /// The encoder cannot be used, for this reason. The board tries again by itself.
    Failed(FaultCode),
}

impl EncoderState {
    /// Whether the axis may be moved.
    #[must_use]
    pub const fn is_usable(self) -> bool {
        !matches!(self, Self::Starting | Self::Failed(_))
    }
}

impl fmt::Display for EncoderState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain => f.write_str("counts only"),
            Self::Indexed { passes: 0, .. } => f.write_str("no index pulse passed yet"),
            Self::Indexed { passes, drift, worst } => {
                write!(f, "{passes} index pulses passed, drift {drift:+} counts, largest {worst:+}")
            }
            Self::Starting => f.write_str("has not answered yet"),
            Self::Absolute { reading, gain } => write!(f, "absolute, reads {reading}, gain {gain} of 255"),
            Self::Failed(code) => write!(f, "not usable: {code}"),
        }
    }
}
