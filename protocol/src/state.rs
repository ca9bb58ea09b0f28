//! States of the controller and phases of a move.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// State of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum ControllerState {
    /// Disarmed: the drivers are off.
    Idle,
    /// Armed, at rest.
    Ready,
    /// Searching the reference.
    Homing,
    /// On the way to a target, or settling there.
    Moving,
    /// Decelerating on request.
    Stopping,
    /// The lease expired: decelerating or at rest, latched until cleared.
    LinkLost,
    /// A fault is latched until cleared.
    Fault,
    /// The board starts.
    Boot,
    /// Checking encoders, switches and settings before anything may move.
    SelfTest,
    /// Receiving a firmware image; nothing may move.
    Updating,
    /// New firmware runs on trial; nothing may move until it is confirmed.
    Trial,
}

impl fmt::Display for ControllerState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Idle => "idle",
            Self::Ready => "ready",
            Self::Homing => "homing",
            Self::Moving => "moving",
            Self::Stopping => "stopping",
            Self::LinkLost => "link lost",
            Self::Fault => "fault",
            Self::Boot => "starting",
            Self::SelfTest => "self-test",
            Self::Updating => "taking firmware",
            Self::Trial => "firmware on trial",
        })
    }
}

/// Phase of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum MovePhase {
    /// There has been no move.
    None,
    /// The trajectory runs.
    Running,
    /// The trajectory is over; the encoders must stay inside the tolerance for a while.
    Settling,
    /// The encoders show that the targets are reached.
    Settled,
    /// Stopped before the targets were reached.
    Stopped,
}
