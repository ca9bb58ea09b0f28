//! What a link measures while it is open: the board's clock, the axes' positions, and its own statistics.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use vergence_protocol::{HostStatistics, Microseconds, PoseReport};
use vergence_rig::{ClockMap, Exchange, JointSample, JointTrack, JointsAt};

use super::lost_encoders::{LostAxis, LostEncoders, Told, is_moving};

/// Poses that are kept: half a minute at the board's usual rate.
const TRACK_LENGTH: usize = 16_000;

/// What a link has measured so far. Clones share the data; the link's task writes it, everybody else reads.
#[derive(Clone)]
pub struct BoardKnowledge {
    measured: Arc<Mutex<Measured>>,
    listeners: Arc<Mutex<Vec<Listener>>>,
    baud: Option<u32>,
}

type Listener = Box<dyn FnMut(&BoardNews) + Send>;

/// What the board says that is kept.
#[derive(Clone, Debug, PartialEq)]
pub enum BoardNews {
    /// Where its encoders are.
    Pose(PoseReport),
    /// The host asked it for its time.
    ProbeSent,
    /// It told its time.
    Exchange(Exchange),
    /// The link ended: it says nothing more.
    LinkEnded,
    /// A link is there again: to the same board, which may have restarted meanwhile.
    LinkBack,
}

/// The last reading before the link ended.
#[derive(Clone, Debug, PartialEq)]
pub struct LastReading {
    /// The readings of all axes.
    pub joints: JointsAt,
    /// The instant of the reading, on the board's clock.
    pub at: Microseconds,
    /// Whether the board was moving the axes.
    pub moving: bool,
}

#[derive(Debug)]
struct Measured {
    clock_map: ClockMap,
    track: JointTrack,
    encoders: LostEncoders,
    last: Option<LastReading>,
    has_ended: bool,
    statistics: HostStatistics,
}

impl Measured {
    fn new(baud: Option<u32>, encoders: LostEncoders) -> Self {
        Self {
            clock_map: baud.map_or_else(ClockMap::default, ClockMap::at_baud),
            track: JointTrack::new(TRACK_LENGTH),
            encoders,
            last: None,
            has_ended: false,
            statistics: HostStatistics::default(),
        }
    }
}

impl BoardKnowledge {
    /// Empty, for a wire of `baud` bits per second; `None` where bytes take no time.
    #[must_use]
    pub fn new(baud: Option<u32>) -> Self {
        let measured = Measured::new(baud, LostEncoders::default());
        Self { measured: Arc::new(Mutex::new(measured)), listeners: Arc::default(), baud }
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

    /// Whether the link ended, and none has come back.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.lock().has_ended
    }

    /// The last reading of a link that ended; `None` of one that is there, or told nothing.
    #[must_use]
    pub fn last_reading(&self) -> Option<LastReading> {
        let measured = self.lock();
        measured.last.clone().filter(|_| measured.has_ended)
    }

    /// Counts of frames, retransmissions and poses since the link was opened.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        self.lock().statistics
    }

    pub(super) fn note_statistics(&self, statistics: HostStatistics) {
        self.lock().statistics = statistics;
    }

    /// Takes what the board said. A replay does it with what was recorded.
    pub fn note(&self, news: &BoardNews) {
        for listener in self.listeners.lock().unwrap_or_else(PoisonError::into_inner).iter_mut() {
            listener(news);
        }
        let mut measured = self.lock();
        match news {
            BoardNews::Pose(pose) => {
                measured.track.push(JointSample { at: pose.at, counts: pose.counts.clone() });
                measured.encoders.note(pose);
                let (joints, moving) = (JointsAt::latched(&pose.counts), is_moving(pose.state));
                measured.last = Some(LastReading { joints, at: pose.at, moving });
            }
            BoardNews::ProbeSent => measured.clock_map.probe_sent(),
            BoardNews::Exchange(exchange) => measured.clock_map.observe(*exchange),
            BoardNews::LinkEnded => measured.has_ended = true,
            // The board's clock may have begun anew.
            BoardNews::LinkBack => *measured = Measured::new(self.baud, LostEncoders::after_restart()),
        }
    }

    /// Calls `listener` with all that the board says from now on, on the link's task: it must be quick.
    pub fn listen(&self, listener: impl FnMut(&BoardNews) + Send + 'static) {
        self.listeners.lock().unwrap_or_else(PoisonError::into_inner).push(Box::new(listener));
    }

    /// The speed of the wire in bits per second; `None` where bytes take no time.
    #[must_use]
    pub const fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// A poisoned lock only means that another thread panicked; no update leaves the data half written.
    fn lock(&self) -> MutexGuard<'_, Measured> {
        self.measured.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for BoardKnowledge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BoardKnowledge").field("measured", &self.measured).finish_non_exhaustive()
    }
}
