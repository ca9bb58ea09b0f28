//! The promises, and the record of a broken one.

use std::fmt;

use vergence_protocol::Microseconds;

/// A promise of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// The load stays inside the hard limit switches.
    HardLimit,
    /// Drivers go on only when a session with a valid lease arms; motors step only with drivers on.
    Armed,
    /// Motors stop in time after the lease expires.
    Lease,
    /// Motors stop in time after a stop is requested, and the drivers go off where it asks for that.
    Stops,
    /// The drivers go off while the emergency stop is pressed.
    EmergencyStop,
    /// No axis with a reference moves on outside its range.
    Range,
    /// Moves that are not allowed are refused.
    Refuses,
    /// Without reference no axis moves faster than homing does, and none ever faster than its setting.
    Gentle,
    /// Reported positions are true.
    Position,
    /// The times that the board states fit one offset between its clock and the true time.
    Clock,
    /// The cameras saw each reported pulse, where it is reported.
    Trigger,
    /// A mode is reported only while the load is at its target.
    Mode,
    /// An axis whose encoder is lost stops.
    Follows,
    /// The first fault is kept until it is cleared.
    FirstFault,
    /// The state of the board in a pose is true.
    State,
    /// Every motion and every request ends, and in the end everything is at rest.
    Ends,
}

/// A broken promise.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// The true time.
    pub at: Microseconds,
    /// The promise.
    pub promise: Promise,
    /// The observation that contradicts the promise.
    pub what: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.promise, self.what)
    }
}

/// Relation of an encoder's reading to the position of its load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderReading {
    /// The true position.
    Clear,
    /// The true position with noise.
    Blurred,
    /// Unrelated to the position.
    Lost,
}
