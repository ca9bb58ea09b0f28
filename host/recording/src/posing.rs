//! Pairs the images of a recording as the live loop does, and tells where the cameras were. No exposure is left out because somebody is busy, so that the
//! result depends on the recording alone.

use std::collections::{BTreeMap, VecDeque};

use vergence_board::{BoardKnowledge, BoardNews};
use vergence_camera::{CameraEvent, PendingImage};
use vergence_live::{Posed, PosedExposure, READINGS, Totals, pose};
use vergence_pipeline::{Exposed, Exposures, SkipReason, TimeBase};
use vergence_protocol::Microseconds;
use vergence_rig::{Rig, StampedImage};

use crate::event::{Beginning, Event, exchange_of};
use crate::play::Audience;
use crate::reader::Heard;

/// The exposures of a recording with their poses, event by event.
pub struct Posing<'a, A: Audience> {
    /// Who follows it.
    pub audience: A,
    rig: &'a Rig,
    board: Option<BoardKnowledge>,
    exposures: Exposures<PendingImage>,
    /// Exposures whose encoder readings have not come yet, each with the time at which the wait for them began.
    waiting: VecDeque<(u64, Exposed<PendingImage>)>,
    pulses: u64,
}

impl<'a, A: Audience> Posing<'a, A> {
    /// For a recording of `rig`, which begins, before `audience`.
    #[must_use]
    pub fn new(rig: &'a Rig, audience: A) -> Self {
        Self { audience, rig, board: None, exposures: Exposures::new(None), waiting: VecDeque::new(), pulses: 0 }
    }

    /// Adds what was left out so far, and the pulses, to `totals`.
    pub fn account(&self, totals: &mut Totals) {
        for (reason, count) in self.exposures.skipped() {
            *totals.skipped.entry(*reason).or_default() += count;
        }
        totals.pulses += self.pulses;
        totals.open += self.exposures.open() + self.waiting.len() as u64;
    }

    /// Exposures that were left out so far, by reason.
    #[must_use]
    pub const fn skipped(&self) -> &BTreeMap<SkipReason, u64> {
        self.exposures.skipped()
    }

    /// Counts an exposure that the caller leaves out.
    pub fn skip(&mut self, reason: SkipReason) {
        self.exposures.skip(reason);
    }

    /// Takes the next event, and returns the exposures that it completes, in their order.
    pub fn take(&mut self, heard: Heard) -> Vec<PosedExposure> {
        let now = heard.host_us;
        self.exposures.settle(Microseconds(now), &self.base());
        self.hear(heard);
        while let Some(exposed) = self.exposures.take() {
            self.waiting.push_back((now, exposed));
        }
        self.known(now)
    }

    /// The exposures that can be told after the last event.
    pub fn finish(&mut self) -> Vec<PosedExposure> {
        self.known(u64::MAX)
    }

    fn base(&self) -> TimeBase {
        self.board.as_ref().map_or(TimeBase::Host, |board| TimeBase::Board(board.clock_map()))
    }

    fn hear(&mut self, heard: Heard) {
        let base = self.base();
        self.audience.hear(&heard, self.board.as_ref());
        match (heard.event, heard.image) {
            (Event::Begun(Beginning { has_board, baud, period_us }), _) => {
                self.board = has_board.then(|| BoardKnowledge::new(baud));
                self.exposures = Exposures::new(period_us);
            }
            (Event::Pose(pose), _) => self.note(&BoardNews::Pose(pose)),
            (Event::ProbeSent, _) => self.note(&BoardNews::ProbeSent),
            (Event::Exchange(stamps), _) => self.note(&BoardNews::Exchange(exchange_of(stamps))),
            (Event::LinkEnded, _) => {
                self.note(&BoardNews::LinkEnded);
                self.exposures.link_ended();
            }
            (Event::LinkBack, _) => {
                self.note(&BoardNews::LinkBack);
                self.exposures.link_back();
            }
            (Event::Pulse(mark), _) => {
                self.pulses += 1;
                self.exposures.pulse(&mark, &base);
            }
            (Event::Attached(eye, timing), _) => self.exposures.camera_ready(eye.side(), timing.into(), &base),
            (Event::Lost(eye, why), _) => self.exposures.camera_failed(eye.side(), why, &base),
            (Event::Image(eye, stamp), Some(image)) => {
                let pending = PendingImage {
                    seq: stamp.seq,
                    middle: StampedImage::from(stamp).middle,
                    bytes: None,
                    develop: Box::new(move || Ok(image)),
                };
                if let CameraEvent::Image(pending) = self.audience.camera(eye.side(), CameraEvent::Image(pending)) {
                    self.exposures.image(eye.side(), stamp.into(), pending, &base);
                }
            }
            // It is left out.
            (Event::Image(..), None) => {}
        }
    }

    fn note(&self, news: &BoardNews) {
        if let Some(board) = &self.board {
            board.note(news);
        }
    }

    /// Exposures in their order, as far as their poses are known at `now`.
    fn known(&mut self, now: u64) -> Vec<PosedExposure> {
        let patience = u64::try_from(READINGS.as_micros()).unwrap_or(u64::MAX);
        let mut known = Vec::new();
        while let Some((since, exposed)) = self.waiting.pop_front() {
            match pose(exposed, self.rig, self.board.as_ref()) {
                Posed::Ready(posed) => known.push(posed),
                Posed::Skipped(reason) => self.exposures.skip(reason),
                Posed::NotYet(exposed) if now.saturating_sub(since) < patience => {
                    self.waiting.push_front((since, exposed));
                    break;
                }
                Posed::NotYet(_) => self.exposures.skip(SkipReason::EncodersSilent),
            }
        }
        known
    }
}
