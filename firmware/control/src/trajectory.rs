//! A profile placed in space and time.

use vergence_protocol::Microseconds;

use crate::profile::{MotionState, Profile};
use crate::settings::q8;

/// A running profile: from `origin` (1/256 micro-units) at `started`.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory {
    origin: i64,
    started: Microseconds,
    profile: Profile,
}

impl Trajectory {
    /// Starts `profile` at `origin` and `started`.
    pub fn new(origin: i64, started: Microseconds, profile: Profile) -> Self {
        Self { origin, started, profile }
    }

    /// The position at `time` in 1/256 micro-units.
    pub fn position(&self, time: Microseconds) -> i64 {
        self.origin + q8(self.state(time).offset)
    }

    /// Velocity and acceleration at `time`; the offset is from the origin.
    pub fn state(&self, time: Microseconds) -> MotionState {
        self.profile.at(self.elapsed(time))
    }

    /// Whether it is over at `time`.
    pub fn is_over(&self, time: Microseconds) -> bool {
        self.elapsed(time) >= self.profile.duration()
    }

    fn elapsed(&self, time: Microseconds) -> f32 {
        time.0.saturating_sub(self.started.0) as f32 * 1e-6
    }
}
