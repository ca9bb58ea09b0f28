//! Which images belong together, and when they were exposed.
//!
//! Images, trigger pulses and time come in as arguments, in any order; [`Exposures::take`] hands out what can be measured. An
//! image is any value `T`: it is kept and handed out, not looked at.

mod free_running;
mod outcome;
mod triggered;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use vergence_protocol::{Microseconds, TriggerMark};
use vergence_rig::{BoardInstant, ClockMap, ExposureTiming, HostInstant, StampedImage};
use vergence_vision::Side;

use self::free_running::FreeRunning;
pub use self::outcome::{Ambiguity, CameraGone, Exposed, ExposedImage, SkipReason};
use self::triggered::Triggered;

/// Images and marks on their way for longer than this are lost, in microseconds.
const PATIENCE_US: f64 = 500_000.0;

/// The clock of the instants in an [`ExposedImage`].
#[derive(Clone, Debug)]
pub enum TimeBase {
    /// The board's clock, as far as it is known now.
    Board(ClockMap),
    /// The host's clock: there is no board.
    Host,
}

impl TimeBase {
    /// A stamp of the host on this clock; `None` while the board's clock is not known.
    fn instant(&self, stamp: HostInstant) -> Option<BoardInstant> {
        match self {
            Self::Host => Some(BoardInstant { us: stamp.us, error_us: stamp.error_us }),
            Self::Board(clock) => {
                let at = clock.board_at(Microseconds(stamp.us.max(0.0) as u64))?;
                Some(BoardInstant { error_us: at.error_us + stamp.error_us, ..at })
            }
        }
    }
}

/// Pairs the images of both cameras: by the pulses that fired them, or by their time stamps.
pub struct Exposures<T> {
    cameras: [CameraQueue<T>; 2],
    /// Time between pulses of the trigger in microseconds; `None` where the cameras run freely.
    period_us: Option<f64>,
    pairing: Pairing<T>,
    results: Results<T>,
}

enum Pairing<T> {
    Triggered(Triggered<T>),
    FreeRunning(FreeRunning),
}

/// Images and marks of one camera that wait for each other.
struct CameraQueue<T> {
    timing: Option<ExposureTiming>,
    /// `None` while it delivers.
    gone: Option<CameraGone>,
    /// Images whose partner is not known yet, by number, with their stamps.
    images: BTreeMap<u32, (HostInstant, T)>,
}

impl<T> CameraQueue<T> {
    fn empty() -> Self {
        Self { timing: None, gone: Some(CameraGone::Unknown), images: BTreeMap::new() }
    }

    fn remove(&mut self, seq: u32) -> Option<(HostInstant, T)> {
        self.images.remove(&seq)
    }
}

/// Pairs and losses decided so far.
struct Results<T> {
    ready: VecDeque<Exposed<T>>,
    skipped: BTreeMap<SkipReason, u64>,
    /// `None` until there is one; it is handed out once.
    ambiguity: Option<Ambiguity>,
    ambiguity_taken: bool,
}

impl<T> Results<T> {
    fn skip(&mut self, reason: SkipReason) {
        *self.skipped.entry(reason).or_default() += 1;
    }
}

impl<T> Exposures<T> {
    /// For cameras that a trigger fires every `period_us` microseconds, or that run freely.
    #[must_use]
    pub fn new(period_us: Option<f64>) -> Self {
        let pairing = match period_us {
            Some(period_us) => Pairing::Triggered(Triggered::new(period_us)),
            None => Pairing::FreeRunning(FreeRunning::default()),
        };
        let results =
            Results { ready: VecDeque::new(), skipped: BTreeMap::new(), ambiguity: None, ambiguity_taken: false };
        Self { cameras: [CameraQueue::empty(), CameraQueue::empty()], period_us, pairing, results }
    }

    /// Why each camera (left, right) delivers nothing; `None` for one that delivers.
    #[must_use]
    pub fn gone(&self) -> [Option<&CameraGone>; 2] {
        self.cameras.each_ref().map(|camera| camera.gone.as_ref())
    }

    /// Number of exposures skipped so far, by reason.
    #[must_use]
    pub const fn skipped(&self) -> &BTreeMap<SkipReason, u64> {
        &self.results.skipped
    }

    /// Number of pulses, or of exposures that can be measured, of which nothing is decided yet.
    #[must_use]
    pub fn open(&self) -> u64 {
        let pulses = match &self.pairing {
            Pairing::Triggered(triggered) => triggered.open(),
            Pairing::FreeRunning(_) => 0,
        };
        (pulses + self.results.ready.len()) as u64
    }

    /// Counts an exposure that the caller skips.
    pub fn skip(&mut self, reason: SkipReason) {
        self.results.skip(reason);
    }

    /// The first case of images that time cannot tell apart. It is returned once.
    pub fn take_ambiguity(&mut self) -> Option<Ambiguity> {
        let first = self.results.ambiguity.filter(|_| !self.results.ambiguity_taken);
        self.results.ambiguity_taken |= first.is_some();
        first
    }

    /// The next exposure that can be measured, oldest first.
    pub fn take(&mut self) -> Option<Exposed<T>> {
        self.results.ready.pop_front()
    }

    /// A camera is there, or there again, and exposes its images with this timing.
    pub fn camera_ready(&mut self, side: Side, timing: ExposureTiming, base: &TimeBase) {
        let camera = &mut self.cameras[side.index()];
        *camera = CameraQueue { timing: Some(timing), gone: None, images: BTreeMap::new() };
        match &mut self.pairing {
            Pairing::Triggered(triggered) => triggered.camera_ready(side, timing),
            Pairing::FreeRunning(free) => free.set_periods(periods(&self.cameras)),
        }
        self.decide(base);
    }

    /// A camera failed, and why.
    pub fn camera_failed(&mut self, side: Side, why: String, base: &TimeBase) {
        self.cameras[side.index()].gone = Some(CameraGone::Failed(why));
        self.decide(base);
    }

    /// A camera delivered an image.
    pub fn image(&mut self, side: Side, stamp: StampedImage, image: T, base: &TimeBase) {
        let other = self.cameras[side.other().index()].gone.clone();
        let kept = match (&mut self.pairing, other) {
            (Pairing::Triggered(triggered), _) => triggered.image(side, stamp, &mut self.results),
            (Pairing::FreeRunning(free), None) => free.image(side, stamp),
            (Pairing::FreeRunning(_), Some(why)) => {
                match base.instant(stamp.middle) {
                    Some(middle) => {
                        let image = Box::new(ExposedImage { image, middle });
                        self.results.ready.push_back(Exposed::One { side, image, why });
                    }
                    None => self.results.skip(SkipReason::ClockUnknown),
                }
                return self.decide(base);
            }
        };
        if kept {
            self.cameras[side.index()].images.insert(stamp.seq, (stamp.middle, image));
        }
        self.decide(base);
    }

    /// The board fired the cameras.
    pub fn pulse(&mut self, mark: &TriggerMark, base: &TimeBase) {
        let TimeBase::Board(clock) = base else { return };
        let Some(at) = clock.host_at(mark.at) else { return self.results.skip(SkipReason::ClockUnknown) };
        if let Pairing::Triggered(triggered) = &mut self.pairing {
            triggered.pulse(mark, at);
        }
        self.decide(base);
    }

    /// The link to the board ended, so that no pulses are reported: images are paired by their time stamps, like those of cameras that run
    /// freely.
    pub fn link_ended(&mut self) {
        let Pairing::Triggered(triggered) = &self.pairing else { return };
        for _ in 0..triggered.open() {
            self.results.skip(SkipReason::LinkEnded);
        }
        self.give_up_waiting();
        let mut free = FreeRunning::default();
        free.set_periods(periods(&self.cameras));
        self.pairing = Pairing::FreeRunning(free);
    }

    /// The link to the board is back, and reports pulses again.
    pub fn link_back(&mut self) {
        let Some(period_us) = self.period_us else { return };
        self.give_up_waiting();
        let mut triggered = Triggered::new(period_us);
        for (side, camera) in [Side::Left, Side::Right].into_iter().zip(&self.cameras) {
            camera.timing.into_iter().for_each(|timing| triggered.camera_ready(side, timing));
        }
        self.pairing = Pairing::Triggered(triggered);
    }

    /// Counts the images that wait for a pulse or a partner, which they will not get.
    fn give_up_waiting(&mut self) {
        for _ in self.cameras.iter_mut().flat_map(|camera| std::mem::take(&mut camera.images)) {
            self.results.skip(SkipReason::ImageWithoutPulse);
        }
    }

    /// Gives up what should have arrived half a second before `now`, on the host's clock.
    pub fn settle(&mut self, now: Microseconds, base: &TimeBase) {
        let until_us = now.0 as f64 - PATIENCE_US;
        match &mut self.pairing {
            Pairing::Triggered(triggered) => triggered.settle(until_us),
            Pairing::FreeRunning(free) => free.settle(until_us),
        }
        self.decide(base);
    }

    /// Moves everything that is certain now to the results.
    fn decide(&mut self, base: &TimeBase) {
        match &mut self.pairing {
            Pairing::Triggered(triggered) => triggered.decide(&mut self.cameras, &mut self.results),
            Pairing::FreeRunning(free) => free.decide(&mut self.cameras, base, &mut self.results),
        }
    }
}

/// The time from image to image of each camera (left, right) that has been there.
fn periods<T>(cameras: &[CameraQueue<T>; 2]) -> [Option<Duration>; 2] {
    cameras.each_ref().map(|camera| camera.timing.map(|timing| timing.period))
}
