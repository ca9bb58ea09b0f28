//! Simulated time that follows the clock.

use std::time::Duration;

use tokio::time::Instant;

/// Largest step of simulated time. A process that was suspended for longer must not leap over heartbeats that wait to be read.
const LONGEST_STEP_US: u64 = 20_000;

/// Elapsed time of a simulation that follows the clock but never leaps.
#[derive(Debug)]
pub(super) struct Pace {
    last_asked: Instant,
    elapsed_us: u64,
}

impl Pace {
    /// Starts at zero, now.
    pub(super) fn begin() -> Self {
        Self { last_asked: Instant::now(), elapsed_us: 0 }
    }

    /// Simulated microseconds since the start.
    pub(super) fn elapsed_us(&mut self) -> u64 {
        let passed = u64::try_from((Instant::now() - self.last_asked).as_micros()).unwrap_or(u64::MAX);
        // The fraction of a microsecond is kept for the next call: lost a thousand times a second it would be half a per mille.
        self.last_asked += Duration::from_micros(passed);
        self.elapsed_us += passed.min(LONGEST_STEP_US);
        self.elapsed_us
    }
}
