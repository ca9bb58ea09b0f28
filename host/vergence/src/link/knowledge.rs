//! What a link learns of its board as it goes: time, motion, and how the link itself has been.

use std::sync::{Arc, Mutex, MutexGuard};

use vergence_protocol::HostStatistics;
use vergence_rig::{ClockMap, Exchange, JointSample, JointTrack};

/// Half a minute of poses at the board's usual rate.
const TRACK_LENGTH: usize = 16_000;

/// Shared by the task that hears and those who ask.
#[derive(Clone, Debug)]
pub struct BoardKnowledge(Arc<Mutex<Learned>>);

#[derive(Debug)]
struct Learned {
    clock_map: ClockMap,
    track: JointTrack,
    statistics: HostStatistics,
}

impl BoardKnowledge {
    /// Nothing yet, over a wire of `baud`; `None` where bytes take no time.
    pub(super) fn new(baud: Option<u32>) -> Self {
        Self(Arc::new(Mutex::new(Learned {
            clock_map: baud.map_or_else(ClockMap::default, ClockMap::at_baud),
            track: JointTrack::new(TRACK_LENGTH),
            statistics: HostStatistics::default(),
        })))
    }

    /// The latest clock map.
    #[must_use]
    pub fn clock_map(&self) -> ClockMap {
        self.lock().clock_map.clone()
    }

    /// The encoder readings from `from_us` to `to_us` on the board's clock, as far as they have arrived.
    #[must_use]
    pub fn track_between(&self, from_us: f64, to_us: f64) -> JointTrack {
        self.lock().track.between(from_us, to_us)
    }

    /// How the link has been since it was opened.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        self.lock().statistics
    }

    pub(super) fn note_statistics(&self, statistics: HostStatistics) {
        self.lock().statistics = statistics;
    }

    pub(super) fn note_joints(&self, sample: JointSample) {
        self.lock().track.push(sample);
    }

    pub(super) fn probe_sent(&self) {
        self.lock().clock_map.probe_sent();
    }

    pub(super) fn note_exchange(&self, exchange: Exchange) {
        self.lock().clock_map.observe(exchange);
    }

    /// A poisoned lock only means that another thread panicked; the data is whole.
    fn lock(&self) -> MutexGuard<'_, Learned> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
