//! Events of the board's flight recorder: the last things that happened, kept when a fault is latched.

use core::fmt;

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{ControllerState, Counts, FaultCode, Microseconds, MoveId, Refusal, SessionId, StopKind};

/// Largest number of events in one answer.
pub const EVENTS_PER_ANSWER: usize = 4;

/// A page of recorded events, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordedEvents {
    /// Number of the first event of this page; events are numbered from 0 when the board starts.
    pub first: u32,
    /// Number of events recorded since the board started; those that fell out of the ring are gone.
    pub total: u32,
    /// The events of this page.
    pub events: Vec<RecordedEvent, EVENTS_PER_ANSWER>,
}

/// One recorded event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordedEvent {
    /// Time of the event, board clock.
    pub at: Microseconds,
    /// The recorded event.
    pub what: Happening,
}

/// A recorded event. Append only: the order is the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum Happening {
    /// The board started.
    Started,
    /// A host opened a session.
    Opened(SessionId),
    /// The controller entered this state.
    State(ControllerState),
    /// A move began.
    Move(MoveId),
    /// A request was refused.
    Refused(Refusal),
    /// The host asked for a stop.
    Stop(StopKind),
    /// A fault was raised; only the first one since the last clear is latched.
    Fault {
        /// Cause of the fault.
        code: FaultCode,
        /// Axis of the fault, if it concerns one axis.
        axis: Option<u8>,
        /// Detail of the fault, as in [`crate::FaultRecord`].
        detail: i32,
    },
    /// A switch of an axis changed for good: its contact no longer bounces.
    Switch {
        /// Index of the axis, from 0.
        axis: u8,
        /// True for the home switch, false for the hard limit switch.
        home: bool,
        /// Whether the switch is operated now: home reached (its contact is closed) or a hard limit reached (its
        /// contact is open, or its wire is broken).
        operated: bool,
    },
    /// Position of an axis when the previous fault was recorded.
    Encoder {
        /// Index of the axis, from 0.
        axis: u8,
        /// Encoder counts, from the axis zero if the axis is referenced.
        counts: Counts,
    },
    /// Settings were changed, saved or restored.
    Settings,
}

/// What a switch did, for people. Home switches are normally open, hard limit switches normally closed.
///
/// ```
/// assert_eq!(vergence_protocol::switch_text(true, true), "home switch closed");
/// assert_eq!(vergence_protocol::switch_text(false, true), "hard limit switch opened");
/// ```
#[must_use]
pub const fn switch_text(home: bool, operated: bool) -> &'static str {
    match (home, operated) {
        (true, true) => "home switch closed",
        (true, false) => "home switch opened",
        (false, true) => "hard limit switch opened",
        (false, false) => "hard limit switch closed again",
    }
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
            Self::Switch { axis, home, operated } => {
                write!(f, "axis {axis}: {}", switch_text(*home, *operated))
            }
            Self::Encoder { axis, counts } => write!(f, "axis {axis}: encoder at {}", counts.0),
            Self::Settings => f.write_str("settings changed"),
        }
    }
}
