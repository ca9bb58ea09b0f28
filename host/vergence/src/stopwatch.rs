//! How long computations take. Motion is timed by tokio's clock, which may be virtual; this one is always real.

use std::sync::LazyLock;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use vergence_board::HostClock;

#[allow(clippy::disallowed_methods, reason = "the clock that libraries are given")]
static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Returns the time since this was first asked: the clock for libraries that time their work.
pub fn clock() -> Duration {
    START.elapsed()
}

/// Returns the time at which `clock` started, in microseconds since 1970.
#[allow(clippy::disallowed_methods, reason = "recordings carry the time of day")]
pub fn started_us(clock: HostClock) -> u64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_1970.as_micros()).unwrap_or(u64::MAX).saturating_sub(clock.now().0)
}

/// A running stopwatch.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts.
    #[allow(clippy::disallowed_methods, reason = "the one place that measures how long a computation takes")]
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since the start.
    pub fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
