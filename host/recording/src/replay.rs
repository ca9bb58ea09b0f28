//! Measures a recording as the live loop measures: the same pairing, the same poses, the same clouds.

use vergence_live::{Clock, LiveError, Measurement, PosedExposure, Totals, measure};
use vergence_pipeline::{Method, PoseMemory, SkipReason};
use vergence_rig::Rig;

use crate::play::Audience;
use crate::posing::Posing;
use crate::reader::Heard;

/// A recording that is measured, event by event.
pub struct Replay<'a, A: Audience> {
    rig: &'a Rig,
    method: Method<'a>,
    stopwatch: Clock,
    pub(crate) posing: Posing<'a, A>,
    memory: PoseMemory,
}

impl<'a, A: Audience> Replay<'a, A> {
    /// A replay on `rig`, whose matches are found by `method`, before `audience`; `stopwatch` says how long measuring takes.
    #[must_use]
    pub fn new(rig: &'a Rig, method: Method<'a>, stopwatch: Clock, audience: A) -> Self {
        Self { rig, method, stopwatch, posing: Posing::new(rig, audience), memory: PoseMemory::default() }
    }

    /// Adds what was not measured so far, and the pulses, to `totals`.
    pub fn account(&self, totals: &mut Totals) {
        self.posing.account(totals);
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
        let exposures = self.posing.take(heard);
        self.measure(exposures, publish)
    }

    /// Measures what can be measured after the last event.
    ///
    /// # Errors
    /// As [`Replay::take`].
    pub fn finish<E: From<LiveError>>(
        &mut self,
        publish: &mut impl FnMut(Measurement) -> Result<(), E>,
    ) -> Result<(), E> {
        let exposures = self.posing.finish();
        self.measure(exposures, publish)
    }

    fn measure<E: From<LiveError>>(
        &mut self,
        exposures: Vec<PosedExposure>,
        publish: &mut impl FnMut(Measurement) -> Result<(), E>,
    ) -> Result<(), E> {
        for exposure in exposures {
            match measure(exposure, self.rig, (self.method, false), &mut self.memory, self.stopwatch)? {
                Some(measurement) => publish(measurement)?,
                None => self.posing.skip(SkipReason::AxesUntold),
            }
        }
        Ok(())
    }
}
