//! What the flight recorder kept: the last things that happened before a fault.

use core::fmt;

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{ControllerState, Counts, FaultCode, Microseconds, MoveId, Refusal, SessionId, StopKind};

/// How many fit into one answer.
pub const EVENTS_PER_ANSWER: usize = 4;

/// Some of the recorded events, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordedEvents {
    /// Number of the first one here; numbers count from 0 at start.
    pub first: u32,
    /// How many were recorded since start; those that fell out of the ring are gone.
    pub total: u32,
    /// The events.
    pub events: Vec<RecordedEvent, EVENTS_PER_ANSWER>,
}

/// One event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordedEvent {
    /// When, on the board's clock.
    pub at: Microseconds,
    /// What.
    pub what: Happening,
}

/// What happened. Append only: the order is the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum Happening {
    /// The board started.
    Started,
    /// A host opened a session.
    Opened(SessionId),
    /// The controller changed its state.
    State(ControllerState),
    /// A move began.
    Move(MoveId),
    /// A request was refused.
    Refused(Refusal),
    /// The host asked for a stop.
    Stop(StopKind),
    /// A fault was seen; only the first one since a clear is latched.
    Fault {
        /// What went wrong.
        code: FaultCode,
        /// On which axis, where it concerns one.
        axis: Option<u8>,
        /// As in the fault's record.
        detail: i32,
    },
    /// A switch of an axis changed.
    Switch {
        /// Which axis.
        axis: u8,
        /// Its home switch, or else its limit switch.
        home: bool,
        /// Whether it is closed now.
        closed: bool,
    },
    /// Where an axis was when the event before this one happened.
    Encoder {
        /// Which axis.
        axis: u8,
        /// What its encoder read.
        counts: Counts,
    },
    /// Settings were changed, saved or restored.
    Settings,
}

impl fmt::Display for Happening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started => f.write_str("the board started"),
            Self::Opened(session) => write!(f, "session {:08x} opened", session.0),
            Self::State(state) => write!(f, "state: {state}"),
            Self::Move(id) => write!(f, "move {} began", id.0),
            Self::Refused(refusal) => write!(f, "refused: {refusal}"),
            Self::Stop(StopKind::Decelerate) => f.write_str("asked to stop"),
            Self::Stop(StopKind::TorqueOff) => f.write_str("asked to switch the drivers off"),
            Self::Fault { code, axis: Some(axis), detail } => write!(f, "fault on axis {axis}: {code} ({detail})"),
            Self::Fault { code, axis: None, detail } => write!(f, "fault: {code} ({detail})"),
            Self::Switch { axis, home, closed } => {
                let (which, how) = (if *home { "home" } else { "limit" }, if *closed { "closed" } else { "opened" });
                write!(f, "axis {axis}: {which} switch {how}")
            }
            Self::Encoder { axis, counts } => write!(f, "axis {axis}: encoder at {}", counts.0),
            Self::Settings => f.write_str("settings changed"),
        }
    }
}
