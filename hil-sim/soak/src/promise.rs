//! What is promised, and a promise broken.

use std::fmt;

use vergence_protocol::Microseconds;

/// What is promised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// The load stays inside the hard limit switches.
    HardLimit,
    /// Drivers go on only where a session with a live lease arms; motors step only with drivers on.
    Armed,
    /// Motors stop in time after the lease.
    Lease,
    /// Moves that must not be are refused.
    Refuses,
    /// Without reference no axis moves faster than homing does.
    Gentle,
    /// A mode is reported only at its place.
    Mode,
    /// An axis whose encoder is lost stops.
    Follows,
    /// The first fault is kept until it is cleared.
    FirstFault,
    /// What a pose says of the board is true.
    State,
    /// Every motion and every request ends, and in the end everything stands still.
    Ends,
}

/// A broken promise.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// When, true time.
    pub at: Microseconds,
    /// Which.
    pub promise: Promise,
    /// What was seen.
    pub what: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.promise, self.what)
    }
}

/// What an encoder shows of its load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// The truth.
    Clear,
    /// The truth with noise.
    Blurred,
    /// Nothing.
    Lost,
}
