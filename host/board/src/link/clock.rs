//! The host's clock: microseconds on tokio's clock, which tests and the demo run in virtual time.

use tokio::time::Instant;
use vergence_protocol::Microseconds;

/// A clock that counts microseconds since it was started. Copies share the start.
#[derive(Clone, Copy, Debug)]
pub struct HostClock {
    start: Instant,
}

impl HostClock {
    /// A clock that starts now.
    #[must_use]
    pub fn start() -> Self {
        Self { start: Instant::now() }
    }

    /// Microseconds since the start.
    #[must_use]
    pub fn now(self) -> Microseconds {
        Microseconds(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// The instant at which this clock shows `at`.
    #[must_use]
    pub fn instant(self, at: Microseconds) -> Instant {
        self.start + std::time::Duration::from_micros(at.0)
    }
}
