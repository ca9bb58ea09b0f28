//! What a link measures while it is open: the board's clock, the axes' positions, and its own statistics.

use std::sync::{Arc, Mutex, MutexGuard};

use vergence_protocol::{HostStatistics, PoseReport};
use vergence_rig::{ClockMap, Exchange, JointSample, JointTrack};

use super::lost_encoders::{LostAxis, LostEncoders, Told};

/// Poses that are kept: half a minute at the board's usual rate.
const TRACK_LENGTH: usize = 16_000;

/// What a link has measured so far. Clones share the data; the link's task writes it, everybody else reads.
#[derive(Clone, Debug)]
pub struct BoardKnowledge(Arc<Mutex<Measured>>);

#[derive(Debug)]
struct Measured {
    clock_map: ClockMap,
    track: JointTrack,
    encoders: LostEncoders,
    statistics: HostStatistics,
}

impl BoardKnowledge {
    /// Empty, for a wire of `baud` bits per second; `None` where bytes take no time.
    pub(super) fn new(baud: Option<u32>) -> Self {
        Self(Arc::new(Mutex::new(Measured {
            clock_map: baud.map_or_else(ClockMap::default, ClockMap::at_baud),
            track: JointTrack::new(TRACK_LENGTH),
            encoders: LostEncoders::default(),
            statistics: HostStatistics::default(),
        })))
    }

    /// The latest clock map.
    #[must_use]
    pub fn clock_map(&self) -> ClockMap {
        self.lock().clock_map.clone()
    }

    /// The encoder readings from `from_us` to `to_us`, in microseconds of the board's clock, as far as they have arrived.
    #[must_use]
    pub fn track_between(&self, from_us: f64, to_us: f64) -> JointTrack {
        self.lock().track.between(from_us, to_us)
    }

    /// What the encoders tell of an instant in microseconds of the board's clock, by what is known now.
    #[must_use]
    pub fn told_at(&self, us: f64) -> Told {
        self.lock().encoders.told_at(us)
    }

    /// The axes that no encoder tells now.
    #[must_use]
    pub fn lost_axes(&self) -> Vec<LostAxis> {
        self.lock().encoders.lost().to_vec()
    }

    /// Counts of frames, retransmissions and poses since the link was opened.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        self.lock().statistics
    }

    pub(super) fn note_statistics(&self, statistics: HostStatistics) {
        self.lock().statistics = statistics;
    }

    pub(super) fn note_pose(&self, pose: &PoseReport) {
        let mut measured = self.lock();
        measured.track.push(JointSample { at: pose.at, counts: pose.counts.clone() });
        measured.encoders.note(pose);
    }

    pub(super) fn probe_sent(&self) {
        self.lock().clock_map.probe_sent();
    }

    pub(super) fn note_exchange(&self, exchange: Exchange) {
        self.lock().clock_map.observe(exchange);
    }

    /// A poisoned lock only means that another thread panicked; no update leaves the data half written.
    fn lock(&self) -> MutexGuard<'_, Measured> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
