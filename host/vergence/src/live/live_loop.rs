//! The loop itself: it listens to cameras and board, keeps the newest exposure, and measures it when the matcher is free.

use std::collections::BTreeMap;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::Receiver;
use tokio::time::{Instant, interval, sleep, sleep_until};
use vergence_matching::Matcher;
use vergence_protocol::FrameMark;
use vergence_rig::{Rig, TrackGap, middle_pose};

use super::blindness::Blindness;
use super::exposures::{Exposed, Exposures, TimeBase};
use super::eye::Heard;
use super::measure::{Measured, Motion, Seen, measure, pair_exposure};
use crate::failure::Failure;
use crate::link::{BoardKnowledge, HostClock};

/// How often what never came is given up.
const SETTLE: Duration = Duration::from_millis(20);
/// Encoder readings for an exposure arrive within this, or not at all.
const READINGS: Duration = Duration::from_millis(300);
/// Readings around an exposure that are taken along, in microseconds.
const MARGIN_US: f64 = 250_000.0;

/// When the loop ends by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// After so many results.
    pub results: Option<u64>,
    /// After this time.
    pub time: Option<Duration>,
}

/// Why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// There are as many results as were asked for, or the time is over.
    Done,
    /// Both cameras are dead.
    Blind,
}

/// What became of everything so far.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Clouds.
    pub clouds: u64,
    /// Sets of bearings.
    pub bearings: u64,
    /// What was skipped, by reason.
    pub skipped: BTreeMap<&'static str, u64>,
}

/// What a result of the loop is told with.
pub struct Told<'a> {
    /// The result.
    pub measured: &'a Measured,
    /// From the middle of the exposure until now.
    pub latency: Duration,
    /// What became of everything so far.
    pub totals: &'a Totals,
}

/// Everything that the loop needs. It owns no device.
pub struct LiveLoop {
    /// The rig.
    pub rig: Arc<Rig>,
    /// Finds homologous points.
    pub matcher: Arc<dyn Matcher>,
    /// The cameras.
    pub news: Receiver<Heard>,
    /// The pulses of the camera trigger; `None` where the cameras run freely.
    pub marks: Option<Receiver<FrameMark>>,
    /// What is known of the board; `None` for a rig without axes.
    pub board: Option<BoardKnowledge>,
    /// The host's clock.
    pub clock: HostClock,
    /// Which frames belong together.
    pub exposures: Exposures,
    /// Where time is simulated: matching takes so much of it; `None` as much as it really took.
    pub simulated: Option<Option<Duration>>,
}

/// A measurement under way. The host's time of the exposure goes with it.
type Work = Pin<Box<dyn Future<Output = (f64, Result<Measured, Reason>)>>>;

/// Why an exposure came to nothing.
enum Reason {
    Joints(TrackGap),
    Failed(Failure),
}

impl LiveLoop {
    /// Runs until `limits` are reached or both cameras are dead; tells each result.
    ///
    /// # Errors
    /// Those of `tell`; a pair that cannot be measured whatever the images show; a link that ended.
    pub async fn run(
        &mut self,
        limits: Limits,
        totals: &mut Totals,
        mut tell: impl FnMut(Told<'_>) -> Result<(), Failure>,
        mut warn: impl FnMut(String),
    ) -> Result<Ended, Failure> {
        let deadline = limits.time.map(|time| Instant::now() + time);
        let mut settle = interval(SETTLE);
        let (mut work, mut newest): (Option<Work>, Option<Exposed>) = (None, None);
        let mut blindness = Blindness::default();
        loop {
            if work.is_none() {
                work = newest.take().map(|exposed| self.start(exposed));
            }
            tokio::select! {
                Some(heard) = self.news.recv() => {
                    let base = self.base();
                    self.exposures.hear(heard.side, heard.news, &base);
                }
                mark = next(&mut self.marks) => match mark {
                    Some(mark) => {
                        let base = self.base();
                        self.exposures.pulse(&mark, &base);
                    }
                    None => return Err(Failure::link("the link to the board ended: nothing more can be measured")),
                },
                (exposed_at, done) = finished(&mut work) => {
                    work = None;
                    self.conclude(exposed_at, done, totals, &mut tell)?;
                    if limits.results.is_some_and(|most| totals.clouds + totals.bearings >= most) {
                        return Ok(Ended::Done);
                    }
                }
                _ = settle.tick() => {
                    let base = self.base();
                    self.exposures.settle(self.clock.now(), &base);
                    totals.skipped.clone_from(self.exposures.skipped());
                    if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                        return Ok(Ended::Done);
                    }
                }
            }
            while let Some(exposed) = self.exposures.take() {
                if newest.replace(exposed).is_some() {
                    self.exposures.skip("newer_came");
                }
            }
            self.exposures.take_ambiguity().into_iter().for_each(&mut warn);
            if blindness.note(self.exposures.dead(), &mut warn) && work.is_none() {
                return Ok(Ended::Blind);
            }
        }
    }

    /// Counts what came of an exposure, and tells it.
    fn conclude(
        &mut self,
        exposed_at: f64,
        done: Result<Measured, Reason>,
        totals: &mut Totals,
        tell: &mut impl FnMut(Told<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let measured = match done {
            Ok(measured) => measured,
            Err(Reason::Joints(gap)) => {
                self.exposures.skip(match gap {
                    TrackGap::NotYet => "encoders_silent",
                    _ => "encoders_unknown",
                });
                return Ok(());
            }
            Err(Reason::Failed(failure)) => return Err(failure),
        };
        match measured.seen {
            Seen::Points { .. } => totals.clouds += 1,
            Seen::Bearings { .. } => totals.bearings += 1,
        }
        totals.skipped.clone_from(self.exposures.skipped());
        let latency = (self.clock.now().0 as f64 - exposed_at).max(0.0);
        tell(Told { measured: &measured, latency: Duration::from_micros(latency as u64), totals })
    }

    fn base(&self) -> TimeBase {
        self.board.as_ref().map_or(TimeBase::Host, |board| TimeBase::Board(board.clock_map()))
    }

    /// Begins to measure, beside the link, which must not wait.
    fn start(&self, exposed: Exposed) -> Work {
        let (rig, matcher, board) = (Arc::clone(&self.rig), Arc::clone(&self.matcher), self.board.clone());
        let (simulated, exposed_at) = (self.simulated, host_middle(&exposed));
        Box::pin(async move {
            let motion = match motion(&exposed, &rig, board.as_ref()).await {
                Ok(motion) => motion,
                Err(gap) => return (exposed_at, Err(Reason::Joints(gap))),
            };
            let worked = tokio::task::spawn_blocking(move || measure(exposed, &rig, &motion, matcher.as_ref())).await;
            let outcome = worked.unwrap_or_else(|error| Err(Failure::device(format!("measuring failed: {error}"))));
            // Simulated time stood still meanwhile. Rendering takes none of it: real cameras do not render.
            if let (Some(takes), Ok(measured)) = (simulated, &outcome) {
                sleep(takes.unwrap_or(Duration::from_secs_f64(measured.seconds))).await;
            }
            (exposed_at, outcome.map_err(Reason::Failed))
        })
    }
}

/// The next pulse; never where the cameras run freely.
async fn next(marks: &mut Option<Receiver<FrameMark>>) -> Option<FrameMark> {
    match marks {
        Some(marks) => marks.recv().await,
        None => std::future::pending().await,
    }
}

async fn finished(work: &mut Option<Work>) -> (f64, Result<Measured, Reason>) {
    match work {
        Some(work) => work.await,
        None => std::future::pending().await,
    }
}

/// The middle of the exposure on the host's clock, in microseconds.
fn host_middle(exposed: &Exposed) -> f64 {
    match exposed {
        Exposed::Pair(shots) => shots[0].frame.middle.us,
        Exposed::One { shot, .. } => shot.frame.middle.us,
    }
}

/// The encoder readings that cover an exposure, as soon as they have come.
async fn motion(exposed: &Exposed, rig: &Rig, board: Option<&BoardKnowledge>) -> Result<Motion, TrackGap> {
    let (Some(board), Exposed::Pair(shots)) = (board, exposed) else { return Ok(Motion::Fixed) };
    let middles = shots.each_ref().map(|shot| shot.middle);
    let exposure = pair_exposure(rig, middles);
    let (first, last) = (middles[0].us.min(middles[1].us), middles[0].us.max(middles[1].us));
    let patience = Instant::now() + READINGS;
    loop {
        let track = board.track_between(first - MARGIN_US, last + MARGIN_US);
        match middle_pose(rig, &track, &exposure) {
            Ok(_) => return Ok(Motion::Read(track)),
            Err(TrackGap::NotYet) if Instant::now() < patience => {
                sleep_until(Instant::now() + Duration::from_millis(2)).await;
            }
            Err(gap) => return Err(gap),
        }
    }
}
