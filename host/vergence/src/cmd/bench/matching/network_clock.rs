//! How long networks run.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use vergence_matching::learned::{Network, NetworkError, Signature, Tensor};

use crate::stopwatch::Stopwatch;

/// Adds up how long the networks run that it watches.
#[derive(Clone, Debug, Default)]
pub struct NetworkClock {
    nanoseconds: Arc<AtomicU64>,
}

impl NetworkClock {
    /// The same network, watched.
    pub fn watch(&self, network: Box<dyn Network>) -> Box<dyn Network> {
        Box::new(Watched { network, clock: self.clone() })
    }

    /// Seconds since this was last asked.
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
        let watch = Stopwatch::start();
        let given = self.network.run(inputs, outputs);
        self.clock.nanoseconds.fetch_add((watch.seconds() * 1e9) as u64, Ordering::Relaxed);
        given
    }
}
