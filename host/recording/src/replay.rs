//! Measures a recording as the live loop measures: the same pairing, the same poses, the same clouds. No exposure is skipped because the matcher is busy, so that
//! the result depends on the recording alone.

use std::collections::VecDeque;

use vergence_board::{BoardKnowledge, BoardNews};
use vergence_camera::PendingImage;
use vergence_live::{Clock, LiveError, Measurement, Posed, READINGS, measure, pose};
use vergence_pipeline::{Exposed, Exposures, Method, PoseMemory, SkipReason, TimeBase};
use vergence_protocol::Microseconds;
use vergence_rig::Rig;

use crate::event::{Beginning, Event, exchange_of};
use crate::reader::Heard;

/// A recording that is measured, event by event.
pub struct Replay<'a> {
    rig: &'a Rig,
    method: Method<'a>,
    stopwatch: Clock,
    board: Option<BoardKnowledge>,
    exposures: Exposures<PendingImage>,
    memory: PoseMemory,
    /// Exposures whose encoder readings have not come yet, each with the time at which the wait for them began.
    waiting: VecDeque<(u64, Exposed<PendingImage>)>,
}

impl<'a> Replay<'a> {
    /// A replay on `rig`, whose matches are found by `method`; `stopwatch` says how long measuring takes.
    #[must_use]
    pub fn new(rig: &'a Rig, method: Method<'a>, stopwatch: Clock) -> Self {
        Self {
            rig,
            method,
            stopwatch,
            board: None,
            exposures: Exposures::new(None),
            memory: PoseMemory::default(),
            waiting: VecDeque::new(),
        }
    }

    /// Exposures that were not measured so far, by reason.
    #[must_use]
    pub const fn skipped(&self) -> &std::collections::BTreeMap<SkipReason, u64> {
        self.exposures.skipped()
    }

    /// Takes the next event, and calls `publish` with each measurement that it completes.
    ///
    /// # Errors
    /// Those of [`measure`] and of `publish`.
    pub fn take<E: From<LiveError>>(
        &mut self,
        heard: Heard,
        publish: &mut impl FnMut(Measurement) -> Result<(), E>,
    ) -> Result<(), E> {
        let now = heard.host_us;
        self.exposures.settle(Microseconds(now), &self.base());
        self.hear(heard);
        while let Some(exposed) = self.exposures.take() {
            self.waiting.push_back((now, exposed));
        }
        self.measure_known(now, publish)
    }

    /// Measures what can be measured after the last event.
    ///
    /// # Errors
    /// As [`Replay::take`].
    pub fn finish<E: From<LiveError>>(
        &mut self,
        publish: &mut impl FnMut(Measurement) -> Result<(), E>,
    ) -> Result<(), E> {
        self.measure_known(u64::MAX, publish)
    }

    fn base(&self) -> TimeBase {
        self.board.as_ref().map_or(TimeBase::Host, |board| TimeBase::Board(board.clock_map()))
    }

    fn hear(&mut self, heard: Heard) {
        let base = self.base();
        match (heard.event, heard.image) {
            (Event::Begun(Beginning { has_board, baud, period_us }), _) => {
                self.board = has_board.then(|| BoardKnowledge::new(baud));
                self.exposures = Exposures::new(period_us);
            }
            (Event::Pose(pose), _) => self.note(&BoardNews::Pose(pose)),
            (Event::ProbeSent, _) => self.note(&BoardNews::ProbeSent),
            (Event::Exchange(stamps), _) => self.note(&BoardNews::Exchange(exchange_of(stamps))),
            (Event::Pulse(mark), _) => self.exposures.pulse(&mark, &base),
            (Event::Attached(eye, timing), _) => self.exposures.camera_ready(eye.side(), timing.into(), &base),
            (Event::Lost(eye, why), _) => self.exposures.camera_failed(eye.side(), why, &base),
            (Event::Image(eye, stamp), Some(image)) => {
                let pending = PendingImage {
                    seq: stamp.seq,
                    middle: vergence_rig::StampedImage::from(stamp).middle,
                    bytes: None,
                    develop: Box::new(move || Ok(image)),
                };
                self.exposures.image(eye.side(), stamp.into(), pending, &base);
            }
            // The reader gives each its image.
            (Event::Image(..), None) => {}
        }
    }

    fn note(&self, news: &BoardNews) {
        if let Some(board) = &self.board {
            board.note(news);
        }
    }

    /// Measures exposures in their order, as far as their poses are known at `now`.
    fn measure_known<E: From<LiveError>>(
        &mut self,
        now: u64,
        publish: &mut impl FnMut(Measurement) -> Result<(), E>,
    ) -> Result<(), E> {
        let patience = u64::try_from(READINGS.as_micros()).unwrap_or(u64::MAX);
        while let Some((since, exposed)) = self.waiting.pop_front() {
            let posed = match pose(exposed, self.rig, self.board.as_ref()) {
                Posed::Ready(posed) => posed,
                Posed::Skipped(reason) => {
                    self.exposures.skip(reason);
                    continue;
                }
                Posed::NotYet(exposed) if now.saturating_sub(since) < patience => {
                    self.waiting.push_front((since, exposed));
                    return Ok(());
                }
                Posed::NotYet(_) => {
                    self.exposures.skip(SkipReason::EncodersSilent);
                    continue;
                }
            };
            match measure(posed, self.rig, self.method, &mut self.memory, self.stopwatch)? {
                Some(measurement) => publish(measurement)?,
                None => self.exposures.skip(SkipReason::AxesUntold),
            }
        }
        Ok(())
    }
}
