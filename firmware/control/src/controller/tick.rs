//! The control tick: watch, decide, command.

use vergence_protocol::{ControllerState, FaultCode, Microseconds, MovePhase};

use super::Controller;
use crate::TICK_US;
use crate::axis::Axis;
use crate::homing::Progress;
use crate::io::RigIo;

/// The encoder must stay inside the tolerance this long before a move counts as reached.
const DWELL_US: u64 = 50_000;
/// A move that has not settled this long after its trajectory ended is a fault.
const SETTLE_TIMEOUT_US: u64 = 1_000_000;

impl Controller {
    /// One control tick: watches inputs and lease, runs homing, moves and stops, commands the motors.
    /// Returns when it wants to run again.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) -> Microseconds {
        self.watch_inputs(now, io);
        self.watch_lease(now);
        match self.state {
            ControllerState::Homing => self.poll_homing(now, io),
            ControllerState::Moving => self.poll_move(now, io),
            ControllerState::Stopping if !self.any_moving() => self.finish_stop(io),
            _ => {}
        }
        if self.drivers_on {
            for axis in &mut self.axes {
                axis.advance(now, io);
            }
            self.watch_following(now, io);
        }
        Microseconds(now.0 + TICK_US)
    }

    fn watch_inputs(&mut self, now: Microseconds, io: &mut impl RigIo) {
        if !self.drivers_on {
            return;
        }
        if io.emergency_stop() {
            self.cut(now, FaultCode::EmergencyStop, None, 0, io);
        } else if let Some(axis) = (0..self.axes.len()).find(|&axis| io.hard_limit(axis)) {
            self.cut(now, FaultCode::HardLimit, Some(axis), 0, io);
        }
    }

    fn watch_lease(&mut self, now: Microseconds) {
        let Some(holder) = self.holder else { return };
        if self.is_latched() || self.lease.is_live(now, holder) {
            return;
        }
        let silence = i32::try_from(self.lease.silence(now)).unwrap_or(i32::MAX);
        self.brake(now);
        self.state = ControllerState::LinkLost;
        self.raise(now, FaultCode::LeaseExpired, None, silence);
    }

    fn watch_following(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let lost = self.axes.iter().enumerate().find_map(|(index, axis)| {
            let error = axis.following_error(io);
            (error.abs() > axis.settings.following_error.0).then_some((index, error))
        });
        if let Some((axis, error)) = lost {
            self.cut(now, FaultCode::FollowingError, Some(axis), error, io);
        }
    }

    fn poll_homing(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let mut all_done = true;
        let mut failed = None;
        for (index, (axis, homing)) in self.axes.iter_mut().zip(&mut self.homing).enumerate() {
            let Some(running) = homing else { continue };
            match running.poll(now, axis, io) {
                Progress::Done => *homing = None,
                Progress::Running => all_done = false,
                Progress::Failed { code, detail } => failed = failed.or(Some((index, code, detail))),
            }
        }
        if let Some((axis, code, detail)) = failed {
            self.fail_softly(now, code, axis, detail);
        } else if all_done {
            self.state = ControllerState::Ready;
        }
    }

    fn poll_move(&mut self, now: Microseconds, io: &impl RigIo) {
        if self.any_moving() {
            return;
        }
        if self.active.phase == MovePhase::Running {
            self.active.phase = MovePhase::Settling;
            self.active.settle_by = Microseconds(now.0 + SETTLE_TIMEOUT_US);
            self.tell_phase();
        }
        if !self.inside_tolerance(io) {
            self.active.inside_since = None;
            if now >= self.active.settle_by {
                let (axis, error) = self.worst_error(io);
                self.fail_softly(now, FaultCode::NotSettled, axis, error);
            }
            return;
        }
        let since = *self.active.inside_since.get_or_insert(now);
        if now.0 - since.0 >= DWELL_US {
            self.active.phase = MovePhase::Settled;
            self.state = ControllerState::Ready;
            self.tell_phase();
        }
    }

    fn worst_error(&self, io: &impl RigIo) -> (usize, i32) {
        let errors = self.axes.iter().zip(&self.active.targets).map(|(axis, target)| target.0 - axis.position(io).0);
        errors.enumerate().max_by_key(|(_, error)| error.abs()).unwrap_or((0, 0))
    }

    fn finish_stop(&mut self, io: &mut impl RigIo) {
        if self.disarm_at_rest {
            self.go_idle(io);
        } else {
            self.state = ControllerState::Ready;
        }
    }

    /// A fault after which the stages can still be braked and held: the reference survives.
    fn fail_softly(&mut self, now: Microseconds, code: FaultCode, axis: usize, detail: i32) {
        self.brake(now);
        self.state = ControllerState::Fault;
        self.raise(now, code, Some(axis), detail);
    }

    /// A fault after which nothing can be trusted: drivers off, references gone.
    fn cut(&mut self, now: Microseconds, code: FaultCode, axis: Option<usize>, detail: i32, io: &mut impl RigIo) {
        self.abort_motion();
        self.cut_drivers(io);
        self.axes.iter_mut().for_each(Axis::forget_reference);
        self.state = ControllerState::Fault;
        self.raise(now, code, axis, detail);
    }
}
