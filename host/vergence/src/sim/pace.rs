//! Simulated time beside the clock.

use std::time::Duration;

use tokio::time::Instant;

/// When this process was kept from running for longer, simulated time slips instead of leaping over heartbeats that wait to be read.
const LONGEST_STEP_US: u64 = 20_000;

/// How much time has passed for a simulation that follows the clock but never leaps.
#[derive(Debug)]
pub struct Pace {
    last_asked: Instant,
    elapsed_us: u64,
}

impl Pace {
    /// No time has passed yet.
    pub fn begin() -> Self {
        Self { last_asked: Instant::now(), elapsed_us: 0 }
    }

    /// Microseconds that have passed for the simulation.
    pub fn elapsed_us(&mut self) -> u64 {
        let passed = u64::try_from((Instant::now() - self.last_asked).as_micros()).unwrap_or(u64::MAX);
        // What is left of a microsecond counts the next time: a thousand times each second it would be half a per mille.
        self.last_asked += Duration::from_micros(passed);
        self.elapsed_us += passed.min(LONGEST_STEP_US);
        self.elapsed_us
    }
}
