//! The end of a move: the encoders must stay inside the tolerance, and a short move may bring them there.

use vergence_protocol::{ControllerState, FaultCode, Microseconds, MovePhase};

use super::Controller;
use crate::io::RigIo;

/// Time in microseconds that the encoders must stay inside the tolerance before a move counts as settled.
const DWELL_US: u64 = 50_000;
/// Longest time in microseconds from the end of a trajectory until the encoders are inside the tolerance.
const SETTLE_TIMEOUT_US: u64 = 1_000_000;
/// Time at rest in microseconds after which an error counts as lasting.
const LASTING_US: u64 = 100_000;
/// Largest number of corrections: one for the error, one for play that the first took up, and as many again.
const MOST_CORRECTIONS: u8 = 4;
/// That of joints, which stick until they lean enough.
const MOST_LEANS: u8 = 12;

impl Controller {
    /// Runs one tick of a move.
    pub(super) fn poll_move(&mut self, now: Microseconds, io: &impl RigIo) {
        if self.planning.is_some() || self.any_moving() {
            return;
        }
        let rests_since = *self.active.rests_since.get_or_insert(now);
        if self.active.phase == MovePhase::Running {
            self.active.phase = MovePhase::Settling;
            self.queue_phase();
        }
        if self.inside_tolerance(io) {
            return self.dwell(now);
        }
        self.active.inside_since = None;
        let (axis, error) = self.worst_error(io);
        if now.0 - rests_since.0 >= LASTING_US && self.may_correct(io) {
            self.correct(io);
        } else if now.0 - rests_since.0 >= SETTLE_TIMEOUT_US {
            self.doubt_references(io);
            self.fail_softly(now, FaultCode::NotSettled, axis, error);
        }
    }

    fn dwell(&mut self, now: Microseconds) {
        let since = *self.active.inside_since.get_or_insert(now);
        if now.0 - since.0 >= DWELL_US {
            self.active.phase = MovePhase::Settled;
            self.state = ControllerState::Ready;
            self.queue_phase();
        }
    }

    /// Whether every axis that is off may correct that.
    fn may_correct(&self, io: &impl RigIo) -> bool {
        let most = if self.axes.iter().all(|axis| axis.settings.is_joint()) { MOST_LEANS } else { MOST_CORRECTIONS };
        self.active.corrections < most
            && self.axes.iter().zip(&self.active.targets).all(|(axis, &target)| {
                axis.is_at(target, io) || axis.error(target, io).0.abs() <= axis.settings.correction.0
            })
    }

    /// Moves to the targets again, from where the encoders are instead of from where the motors should have led.
    fn correct(&mut self, io: &impl RigIo) {
        self.active.corrections += 1;
        self.active.rests_since = None;
        if self.axes.iter().all(|axis| axis.settings.is_joint()) {
            let axes = self.axes.iter_mut().zip(&self.active.targets);
            return axes.for_each(|(axis, &target)| axis.lean_towards(target, io));
        }
        for (axis, &target) in self.axes.iter_mut().zip(&self.active.targets) {
            if !axis.is_at(target, io) {
                axis.adopt_encoder(io);
            }
        }
        self.want_plan();
    }

    /// Forgets where the axes are that are not at their targets: steps or counts were lost, such as in a gap of the encoder's
    /// supply, and nobody can say which of them.
    fn doubt_references(&mut self, io: &impl RigIo) {
        for (axis, &target) in self.axes.iter_mut().zip(&self.active.targets) {
            // A joint knows its angle whatever happens.
            if !axis.settings.is_joint() && !axis.is_at(target, io) {
                axis.forget_reference();
            }
        }
    }

    fn worst_error(&self, io: &impl RigIo) -> (usize, i32) {
        let errors = self.axes.iter().zip(&self.active.targets).map(|(axis, &target)| {
            let error = axis.error(target, io).0;
            (error.abs() / axis.settings.tolerance.0.max(1), error)
        });
        // Axes have different units: what counts is how often the error is the tolerance.
        errors.enumerate().max_by_key(|(_, (share, _))| *share).map_or((0, 0), |(axis, (_, error))| (axis, error))
    }
}
