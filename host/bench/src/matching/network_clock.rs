//! The time that networks run inside a matcher.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use vergence_matching::learned::{Network, NetworkError, Signature, Tensor};

use crate::{Clock, timed};

/// Sums the time that the networks run which it watches.
#[derive(Clone, Debug)]
pub struct NetworkClock {
    nanoseconds: Arc<AtomicU64>,
    clock: Clock,
}

impl NetworkClock {
    /// Reads `clock`, and has watched nothing so far.
    #[must_use]
    pub fn new(clock: Clock) -> Self {
        Self { nanoseconds: Arc::default(), clock }
    }

    /// The same network, watched.
    #[must_use]
    pub fn watch(&self, network: Box<dyn Network>) -> Box<dyn Network> {
        Box::new(Watched { network, clock: self.clone() })
    }

    /// The time now, by the clock that times the networks.
    pub(crate) fn now(&self) -> Duration {
        (self.clock)()
    }

    /// Seconds that the networks ran since this was last called.
    pub fn take(&self) -> f64 {
        self.nanoseconds.swap(0, Ordering::Relaxed) as f64 * 1e-9
    }
}

struct Watched {
    network: Box<dyn Network>,
    clock: NetworkClock,
}

impl Network for Watched {
    fn signature(&self) -> &Signature {
        self.network.signature()
    }

    fn run(&self, inputs: Vec<(&str, Tensor)>, outputs: &[&str]) -> Result<Vec<Tensor>, NetworkError> {
        let (result, seconds) = timed(self.clock.clock, || self.network.run(inputs, outputs));
        self.clock.nanoseconds.fetch_add((seconds * 1e9) as u64, Ordering::Relaxed);
        result
    }
}
