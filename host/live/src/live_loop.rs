//! The loop itself: listens to cameras and board, keeps the newest exposure, and measures it when the matcher is free.

use std::future::{poll_fn, ready};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Poll;
use std::time::Duration;

use tokio::sync::mpsc::Receiver;
use tokio::time::{Instant, interval, sleep, sleep_until};
use vergence_board::{BoardKnowledge, HostClock};
use vergence_camera::{CameraEvent, PendingImage};
use vergence_matching::Matcher;
use vergence_pipeline::{
    Ambiguity, Exposed, Exposures, Method, Observation, PairCost, PointBudget, PointLimit, PoseMemory, Search,
    SkipReason, TimeBase,
};
use vergence_protocol::{Microseconds, TriggerMark};
use vergence_rig::{Rig, StampedImage};
use vergence_vision::Side;

use crate::blindness::Blindness;
use crate::ladder::{Ladder, Notice};
use crate::measure::{Measurement, PosedExposure, measure};
use crate::pace::{Limit, Pace};
use crate::posed::{Posed, READINGS, pose};
use crate::totals::Totals;
use crate::{Clock, LiveError};

/// How often overdue images and pulses are given up.
const SETTLE: Duration = Duration::from_millis(20);

/// After this time, images whose partner has not come are given up: longer than [`Exposures::settle`] takes.
const LAST: Duration = Duration::from_millis(600);

/// When the loop ends without being interrupted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// After this many results.
    pub results: Option<u64>,
    /// After this time.
    pub time: Option<Duration>,
}

/// Why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// A limit was reached, or the cameras have no more images.
    Done,
    /// Both cameras are dead.
    Blind,
}

/// A result of the loop.
pub struct LiveResult<'a> {
    /// Points or bearings.
    pub measurement: &'a Measurement,
    /// Time from the middle of the exposure until now.
    pub latency: Duration,
    /// Counts so far, this result included.
    pub totals: &'a Totals,
    /// How many points were looked for because there was no time for more.
    pub limited: Option<PointLimit>,
    /// Results per second, and what limits them; `None` with the first one.
    pub pace: Option<(f64, Limit)>,
}

impl LiveResult<'_> {
    /// The middle of the exposure on the host's clock, which shows `now`.
    #[must_use]
    pub fn exposed(&self, now: Microseconds) -> Microseconds {
        Microseconds(now.0.saturating_sub(u64::try_from(self.latency.as_micros()).unwrap_or(u64::MAX)))
    }
}

/// How long matching takes on the clock of the loop, which may be simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatchingTime {
    /// The clock is real: it runs while the matcher works.
    Real,
    /// The clock is simulated and stands still meanwhile: it is advanced by the time that matching really took.
    Measured,
    /// The clock is simulated: it is advanced by this time, so that results do not depend on the computer.
    Fixed(Duration),
}

/// The parts of the live loop. It owns no device.
pub struct LiveLoop {
    /// The rig that measures.
    pub rig: Arc<Rig>,
    /// Finds homologous points.
    pub matcher: Arc<dyn Matcher>,
    /// Where it looks for them.
    pub search: Arc<Search>,
    /// Events of both cameras.
    pub events: Receiver<(Side, CameraEvent)>,
    /// Pulses of the camera trigger; `None` where the cameras run freely.
    pub marks: Option<Receiver<TriggerMark>>,
    /// Clock map and encoder track of the board; `None` for a rig without axes.
    pub board: Option<BoardKnowledge>,
    /// The host's clock, on which images are stamped.
    pub clock: HostClock,
    /// Pairs images and pulses.
    pub exposures: Exposures<PendingImage>,
    /// How long matching takes on the clock of the loop.
    pub matching_time: MatchingTime,
    /// Tells how long matching really takes.
    pub stopwatch: Clock,
    /// What images told of the pose while the axes stand.
    pub memory: Arc<Mutex<PoseMemory>>,
    /// How many points the matcher looks for, by what pairs cost; `None` without limit.
    pub budget: Option<PointBudget>,
    /// Whether every pixel of a pair is measured too.
    pub dense: bool,
}

impl MatchingTime {
    /// Advances a simulated clock by the time of `measurement`. Decoding takes none of it: simulated images are rendered,
    /// which a real camera does not do.
    async fn pass(self, measurement: &Measurement) {
        match self {
            Self::Real => {}
            Self::Measured => sleep(Duration::from_secs_f64(measurement.seconds)).await,
            Self::Fixed(time) => sleep(time).await,
        }
    }
}

/// A measurement under way.
type Work = Pin<Box<dyn Future<Output = (Begun, Result<Measurement, NoResult>)>>>;

/// A measurement that has begun.
#[derive(Clone, Copy)]
struct Begun {
    at: Instant,
    /// The middle of the exposure on the host's clock, in microseconds.
    exposed_us: f64,
    limited: Option<PointLimit>,
}

/// Why an exposure gave no result.
enum NoResult {
    Skipped(SkipReason),
    Failed(LiveError),
}

impl LiveLoop {
    /// Runs until `limits` are reached, the cameras have no more images, or both are dead; calls `publish` with each result and `warn` with sentences for
    /// people.
    ///
    /// # Errors
    /// Those of `publish`; [`LiveError`]: a pair that cannot be measured whatever the images show, a link that ended.
    pub async fn run<E: From<LiveError>>(
        &mut self,
        limits: Limits,
        totals: &mut Totals,
        mut publish: impl FnMut(LiveResult<'_>) -> Result<(), E>,
        mut warn: impl FnMut(Notice),
    ) -> Result<Ended, E> {
        let deadline = limits.time.map(|time| Instant::now() + time);
        let mut settle = interval(SETTLE);
        let (mut work, mut newest): (Option<Work>, Option<Exposed<PendingImage>>) = (None, None);
        let (mut blindness, mut ladder, mut over) = (Blindness::default(), Ladder::default(), None::<Instant>);
        let mut had_ended = false;
        let (mut last_us, mut pace) = (None, Pace::default());
        // Cameras that are there already take the first pulse.
        while let Ok((side, event)) = self.events.try_recv() {
            self.take_event(side, event);
        }
        loop {
            if work.is_none() {
                work = newest.take().map(|exposed| self.start(exposed));
            }
            let mut is_done = false;
            tokio::select! {
                event = self.events.recv(), if over.is_none() => match event {
                    Some((side, event)) => self.take_event(side, event),
                    None => over = Some(Instant::now()),
                },
                mark = next(&mut self.marks) => match mark {
                    Some(mark) => {
                        let base = self.base();
                        totals.pulses += 1;
                        self.exposures.pulse(&mark, &base);
                    }
                    None => return Err(LiveError::LinkEnded.into()),
                },
                (begun, done) = finished(&mut work) => {
                    work = None;
                    if let Some(measurement) = self.conclude(done, totals)? {
                        let (latency, limited) = (self.since(begun.exposed_us), begun.limited);
                        let pace = pace.note(measurement.middle.us, totals);
                        self.note_cost(&begun, &measurement);
                        is_done = limits.results.is_some_and(|most| totals.clouds + totals.bearings >= most);
                        // What becomes of the result takes time too; the next pair is measured meanwhile.
                        if !is_done && let Some(exposed) = newest.take() {
                            work = Some(begun_already(self.start(exposed)).await);
                        }
                        let result = LiveResult { measurement: &measurement, latency, totals, limited, pace };
                        ladder.note_result(&result, &mut warn);
                        publish(result)?;
                    }
                }
                _ = settle.tick() => {
                    let base = self.base();
                    self.exposures.settle(self.clock.now(), &base);
                    let is_over = |over: Instant| over.elapsed() > LAST && work.is_none() && newest.is_none();
                    is_done = deadline.is_some_and(|deadline| Instant::now() >= deadline) || over.is_some_and(is_over);
                }
            }
            if let Some(board) = &self.board {
                ladder.note_board(&self.rig, board, &mut warn);
            }
            if self.has_ended() != had_ended {
                had_ended = !had_ended;
                if had_ended { self.exposures.link_ended() } else { self.exposures.link_back() }
            }
            while let Some(exposed) = self.exposures.take() {
                let (exposed_us, budget) = (host_middle(&exposed), self.budget.as_mut());
                let before_us = last_us.replace(exposed_us);
                budget.zip(before_us).into_iter().for_each(|(budget, us)| budget.came_after((exposed_us - us) * 1e-6));
                if newest.replace(exposed).is_some() {
                    self.exposures.skip(SkipReason::NewerCame);
                }
            }
            totals.skipped.clone_from(self.exposures.skipped());
            totals.open = self.exposures.open() + u64::from(newest.is_some()) + u64::from(work.is_some());
            if is_done {
                return Ok(Ended::Done);
            }
            self.exposures.take_ambiguity().map(in_words).map(Notice::from).into_iter().for_each(&mut warn);
            if blindness.note(self.exposures.gone(), &mut warn) && work.is_none() {
                return Ok(Ended::Blind);
            }
        }
    }

    /// Counts the outcome of an exposure.
    fn conclude(
        &mut self,
        done: Result<Measurement, NoResult>,
        totals: &mut Totals,
    ) -> Result<Option<Measurement>, LiveError> {
        let measurement = match done {
            Ok(measurement) => measurement,
            Err(NoResult::Skipped(reason)) => {
                self.exposures.skip(reason);
                return Ok(None);
            }
            Err(NoResult::Failed(error)) => return Err(error),
        };
        totals.count(&measurement.observation);
        totals.skipped.clone_from(self.exposures.skipped());
        Ok(Some(measurement))
    }

    /// Time since the middle of an exposure.
    fn since(&self, exposed_us: f64) -> Duration {
        Duration::from_micros((self.clock.now().0 as f64 - exposed_us).max(0.0) as u64)
    }

    /// Tells the budget what a cloud took until the next pair could begin.
    fn note_cost(&mut self, begun: &Begun, measurement: &Measurement) {
        if let (Some(budget), Observation::Points { .. }) = (&mut self.budget, &measurement.observation) {
            let others = measurement.dense.as_ref().map_or(0.0, |dense| dense.seconds);
            budget.took(PairCost { points: begun.at.elapsed().as_secs_f64() - others, others });
        }
    }

    /// Takes an event of a camera.
    fn take_event(&mut self, side: Side, event: CameraEvent) {
        let base = self.base();
        match event {
            CameraEvent::Attached(timing) => self.exposures.camera_ready(side, timing, &base),
            CameraEvent::Lost(why) => self.exposures.camera_failed(side, why, &base),
            CameraEvent::Image(image) => {
                let stamp = StampedImage { seq: image.seq, middle: image.middle };
                self.exposures.image(side, stamp, image, &base);
            }
        }
    }

    /// Whether the link to the board ended.
    fn has_ended(&self) -> bool {
        self.board.as_ref().is_some_and(BoardKnowledge::has_ended)
    }

    fn base(&self) -> TimeBase {
        self.board.as_ref().map_or(TimeBase::Host, |board| TimeBase::Board(board.clock_map()))
    }

    /// Begins to measure on a thread of its own: the link must not wait.
    fn start(&self, exposed: Exposed<PendingImage>) -> Work {
        let (rig, matcher, board) = (Arc::clone(&self.rig), Arc::clone(&self.matcher), self.board.clone());
        let (search, memory) = (Arc::clone(&self.search), Arc::clone(&self.memory));
        let (matching_time, stopwatch, is_dense) = (self.matching_time, self.stopwatch, self.dense);
        let limited = self.budget.as_ref().and_then(PointBudget::limit);
        let begun = Begun { at: Instant::now(), exposed_us: host_middle(&exposed), limited };
        Box::pin(async move {
            let posed = match posed(exposed, &rig, board.as_ref()).await {
                Ok(posed) => posed,
                Err(why) => return (begun, Err(why)),
            };
            let worked = tokio::task::spawn_blocking(move || {
                let points = limited.map(|limited| limited.most);
                let method = Method { search: &search, points, ..Method::from(matcher.as_ref()) };
                // A poisoned lock only means that another thread panicked; the memory is replaced whole.
                let mut memory = memory.lock().unwrap_or_else(PoisonError::into_inner);
                measure(posed, &rig, (method, is_dense), &mut memory, stopwatch)
            });
            let worked = worked.await;
            let outcome = worked.unwrap_or_else(|error| Err(LiveError::Measuring(error.to_string())));
            let outcome = match outcome {
                Ok(Some(measurement)) => Ok(measurement),
                Ok(None) => Err(NoResult::Skipped(SkipReason::AxesUntold)),
                Err(error) => Err(NoResult::Failed(error)),
            };
            if let Ok(measurement) = &outcome {
                matching_time.pass(measurement).await;
            }
            (begun, outcome)
        })
    }
}

/// A sentence for images that time cannot tell apart.
fn in_words(Ambiguity { side, excess_us }: Ambiguity) -> String {
    format!(
        "images of the {side} camera may belong to either of two pulses: the instant of their exposure is known {:.0} ms too \
         badly for this rate; fire more slowly, or give --exposure and --readout",
        (excess_us / 1000.0).ceil()
    )
}

/// The next pulse; never where the cameras run freely.
async fn next(marks: &mut Option<Receiver<TriggerMark>>) -> Option<TriggerMark> {
    match marks {
        Some(marks) => marks.recv().await,
        None => std::future::pending().await,
    }
}

/// The work, whose measuring has begun on its thread if the pose is there.
async fn begun_already(mut work: Work) -> Work {
    match poll_fn(|context| Poll::Ready(work.as_mut().poll(context))).await {
        Poll::Ready(outcome) => Box::pin(ready(outcome)),
        Poll::Pending => work,
    }
}

async fn finished(work: &mut Option<Work>) -> (Begun, Result<Measurement, NoResult>) {
    match work {
        Some(work) => work.await,
        None => std::future::pending().await,
    }
}

/// The middle of the exposure on the host's clock, in microseconds.
fn host_middle(exposed: &Exposed<PendingImage>) -> f64 {
    match exposed {
        Exposed::Pair(images) => images[0].image.middle.us,
        Exposed::One { image, .. } => image.image.middle.us,
    }
}

/// The exposure with its pose, as soon as the encoder readings that cover it have come.
async fn posed(
    mut exposed: Exposed<PendingImage>,
    rig: &Rig,
    board: Option<&BoardKnowledge>,
) -> Result<PosedExposure, NoResult> {
    let patience = Instant::now() + READINGS;
    loop {
        exposed = match pose(exposed, rig, board) {
            Posed::Ready(posed) => return Ok(posed),
            Posed::Skipped(reason) => return Err(NoResult::Skipped(reason)),
            Posed::NotYet(exposed) if Instant::now() < patience => exposed,
            Posed::NotYet(_) => return Err(NoResult::Skipped(SkipReason::EncodersSilent)),
        };
        sleep_until(Instant::now() + Duration::from_millis(2)).await;
    }
}
