//! Outcome of a request: accepted, or refused for a reason.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::FaultCode;

/// Outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Status {
    /// Accepted; motion that the request started is reported by [`crate::Report::MoveState`].
    Accepted,
    /// Refused: nothing was done.
    Refused(Refusal),
}

/// Reason for a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum Refusal {
    /// The controller is disarmed.
    NotArmed,
    /// Another session holds the armed board.
    WrongSession,
    /// The session's lease has expired or was never taken: send a heartbeat first.
    NoLease,
    /// An axis has no reference: home first.
    NotReferenced {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// A target lies outside the limits; it is not clamped.
    OutsideLimits {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// The axes are in motion: stop first, or wait.
    Busy,
    /// A fault or lost link is latched: clear it first.
    Latched,
    /// No fault is latched, or the latched one has another number.
    WrongFault,
    /// The cause of the fault persists.
    CausePersists,
    /// The request names an axis that does not exist, a wrong number of targets, or a speed of zero.
    Invalid,
    /// The host uses another schema of this protocol: it may only read.
    ReadOnly,
    /// The request is allowed only while disarmed.
    NotIdle,
    /// New firmware is being received or is on trial.
    Updating,
    /// The setting cannot have this value beside the other settings.
    BadSetting,
    /// This board has no such setting.
    NoSetting,
    /// The settings could not be written to flash; the saved ones are unchanged.
    StorageFailed,
    /// The board is set to drive another machine from its next start on.
    NoSuchMachine,
    /// The motor driver of an axis cannot be used.
    DriverNotReady {
        /// Index of the axis, from 0.
        axis: u8,
        /// Why; `None` while the driver gets its settings.
        why: Option<FaultCode>,
    },
    /// No host was heard yet at the new speed of the serial line, so that it cannot be saved.
    LineOnTrial,
    /// An axis is at its hard limit: only a short jog away from it is allowed.
    AtHardLimit {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// The home switch of an axis lies at the other end of the range than the setting `home_end` says.
    HomeSwitchAside {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// The encoder of an axis cannot be used.
    EncoderNotReady {
        /// Index of the axis, from 0.
        axis: u8,
        /// Why; `None` while the encoder has not answered yet.
        why: Option<FaultCode>,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotArmed => f.write_str("the controller is disarmed: arm it first"),
            Self::WrongSession => f.write_str("another session holds the controller: wait until it disarms"),
            Self::NoLease => f.write_str("the board receives no heartbeat from this session"),
            Self::NotReferenced { axis } => write!(f, "axis {axis} has no reference: run 'vergence home' first"),
            Self::OutsideLimits { axis } => write!(f, "the target of axis {axis} lies outside its limits"),
            Self::Busy => f.write_str("the stages are in motion: wait or run 'vergence stop'"),
            Self::Latched => f.write_str("a fault is latched: see 'vergence status', then run 'vergence clear'"),
            Self::WrongFault => f.write_str("there is no such fault to clear"),
            Self::CausePersists => f.write_str("the cause of the fault is still there"),
            Self::Invalid => f.write_str("the request names an axis, a number of targets or a speed that this board does not have"),
            Self::ReadOnly => f.write_str("the board runs another protocol schema: it can be read but not moved"),
            Self::NotIdle => f.write_str("this is allowed only while disarmed: run 'vergence disarm' first"),
            Self::Updating => f.write_str("new firmware is being received or is on trial"),
            Self::BadSetting => f.write_str("the setting cannot have this value beside the others"),
            Self::NoSetting => f.write_str("this board has no such setting"),
            Self::StorageFailed => f.write_str("the board could not write its flash: the old settings are still there"),
            Self::NoSuchMachine => f.write_str(
                "the board is set to drive another machine from its next start on: run 'vergence config save', then restart it",
            ),
            Self::DriverNotReady { axis, why: Some(why) } => {
                write!(f, "axis {axis} cannot be driven: {why}; 'vergence doctor' says what to do")
            }
            Self::DriverNotReady { axis, why: None } => {
                write!(f, "the motor driver of axis {axis} is getting its settings: try again in a second")
            }
            Self::LineOnTrial => f.write_str("the new speed of the line is on trial: open the link at it first"),
            Self::AtHardLimit { axis } => {
                write!(f, "axis {axis} is at its hard limit: only a short 'vergence move --by' away from it is allowed")
            }
            Self::HomeSwitchAside { axis } => write!(
                f,
                "'home_switch_at' of axis {axis} lies at the other end of the range than 'home_end' says: set one of them"
            ),
            Self::EncoderNotReady { axis, why: Some(why) } => {
                write!(f, "axis {axis} does not know where it is: {why}; 'vergence doctor' says what to do")
            }
            Self::EncoderNotReady { axis, why: None } => {
                write!(f, "the encoder of axis {axis} has not answered yet: try again in a second")
            }
        }
    }
}
