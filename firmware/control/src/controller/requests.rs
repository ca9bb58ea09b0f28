//! Requests: each is executed or refused with a reason; nothing is clamped.

use vergence_protocol::{
    AxisList, AxisMask, ControllerState, Microseconds, Move, MovePhase, Permille, Refusal, Request, SessionId, Status,
    StopKind,
};

use super::{ActiveMove, Controller};
use crate::axis::Axis;
use crate::homing::Homing;
use crate::io::RigIo;

impl Controller {
    /// Executes a request of `session` that concerns motion, or says why not. Requests about the link are not its business.
    pub fn handle(&mut self, now: Microseconds, session: SessionId, request: &Request, io: &mut impl RigIo) -> Status {
        let outcome = match request {
            Request::Arm { session: named } if *named == session => self.arm(now, session, io),
            Request::Arm { .. } => Err(Refusal::WrongSession),
            Request::Disarm => self.disarm(now, io),
            Request::Home { axes } => self.home(now, session, *axes),
            Request::MoveTo(target) => self.move_to(now, session, target),
            Request::Stop { kind } => {
                self.stop(now, *kind, io);
                Ok(())
            }
            Request::ClearFault { seen } => self.clear_fault(*seen, io),
            _ => Err(Refusal::Invalid),
        };
        outcome.map_or_else(Status::Refused, |()| Status::Accepted)
    }

    fn arm(&mut self, now: Microseconds, session: SessionId, io: &mut impl RigIo) -> Result<(), Refusal> {
        if self.is_latched() {
            return Err(Refusal::Latched);
        }
        if matches!(self.state, ControllerState::Updating | ControllerState::Trial) {
            return Err(Refusal::Updating);
        }
        if self.holder.is_some_and(|holder| holder != session) {
            return Err(Refusal::WrongSession);
        }
        if !self.lease.is_live(now, session) {
            return Err(Refusal::NoLease);
        }
        if self.holder.is_some() {
            return Ok(());
        }
        if io.emergency_stop() {
            return Err(Refusal::CausePersists);
        }
        for axis in &mut self.axes {
            axis.adopt_encoder(io);
        }
        self.holder = Some(session);
        self.drivers_on = true;
        io.set_drivers(true);
        self.state = ControllerState::Ready;
        Ok(())
    }

    fn disarm(&mut self, now: Microseconds, io: &mut impl RigIo) -> Result<(), Refusal> {
        match self.state {
            ControllerState::Idle => {}
            ControllerState::Ready => self.go_idle(io),
            ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping => {
                self.disarm_at_rest = true;
                self.brake(now);
                self.state = ControllerState::Stopping;
            }
            _ => return Err(Refusal::Latched),
        }
        Ok(())
    }

    /// Checks that `session` may start a motion now.
    fn may_start(&self, now: Microseconds, session: SessionId) -> Result<(), Refusal> {
        match self.state {
            ControllerState::Idle => Err(Refusal::NotArmed),
            ControllerState::LinkLost | ControllerState::Fault => Err(Refusal::Latched),
            ControllerState::Updating | ControllerState::Trial => Err(Refusal::Updating),
            _ if self.holder != Some(session) => Err(Refusal::WrongSession),
            _ if !self.lease.is_live(now, session) => Err(Refusal::NoLease),
            ControllerState::Ready => Ok(()),
            _ => Err(Refusal::Busy),
        }
    }

    fn home(&mut self, now: Microseconds, session: SessionId, axes: AxisMask) -> Result<(), Refusal> {
        self.may_start(now, session)?;
        if axes == AxisMask::default() || axes.0 & !AxisMask::first(self.axes.len()).0 != 0 {
            return Err(Refusal::Invalid);
        }
        for (index, (axis, homing)) in self.axes.iter_mut().zip(&mut self.homing).enumerate() {
            *homing = axes.contains(index).then(|| Homing::start(axis));
        }
        self.active.phase = MovePhase::None;
        self.state = ControllerState::Homing;
        Ok(())
    }

    fn move_to(&mut self, now: Microseconds, session: SessionId, target: &Move) -> Result<(), Refusal> {
        self.may_start(now, session)?;
        if target.targets.len() != self.axes.len() || target.speed.0 == 0 || target.speed > Permille::FULL {
            return Err(Refusal::Invalid);
        }
        for (index, (axis, &position)) in (0u8..).zip(self.axes.iter().zip(&target.targets)) {
            if !axis.is_referenced() {
                return Err(Refusal::NotReferenced { axis: index });
            }
            if position < axis.settings.min || position > axis.settings.max {
                return Err(Refusal::OutsideLimits { axis: index });
            }
        }
        self.start_together(now, target);
        self.active = ActiveMove {
            id: target.id,
            mode: target.mode,
            targets: target.targets.clone(),
            phase: MovePhase::Running,
            inside_since: None,
            settle_by: Microseconds(0),
        };
        self.state = ControllerState::Moving;
        self.tell_phase();
        Ok(())
    }

    /// Every axis gets its own quickest profile, stretched to the time of the slowest: all start and finish together.
    fn start_together(&mut self, now: Microseconds, target: &Move) {
        let factor = f32::from(target.speed.0) / f32::from(Permille::FULL.0);
        let planned: AxisList<_> = self
            .axes
            .iter()
            .zip(&target.targets)
            .map(|(axis, &position)| axis.profile_to(position, axis.settings.limits().scaled(factor)))
            .collect();
        let slowest = planned.iter().map(|profile| profile.duration()).fold(0.0, f32::max);
        for (axis, profile) in self.axes.iter_mut().zip(planned) {
            if profile.duration() > 0.0 {
                axis.run(now, profile.lasting(slowest));
            }
        }
    }

    fn stop(&mut self, now: Microseconds, kind: StopKind, io: &mut impl RigIo) {
        match kind {
            StopKind::Decelerate => {
                if matches!(self.state, ControllerState::Homing | ControllerState::Moving) {
                    self.brake(now);
                    self.state = ControllerState::Stopping;
                }
            }
            StopKind::TorqueOff => {
                let moving = self.any_moving();
                self.abort_motion();
                if self.is_latched() {
                    self.cut_drivers(io);
                } else {
                    self.go_idle(io);
                }
                if moving {
                    self.axes.iter_mut().for_each(Axis::forget_reference);
                }
            }
        }
    }

    fn clear_fault(&mut self, seen: u16, io: &mut impl RigIo) -> Result<(), Refusal> {
        if !self.is_latched() || self.latch.record().is_none_or(|record| record.seq != seen) {
            return Err(Refusal::WrongFault);
        }
        if self.any_moving() {
            return Err(Refusal::Busy);
        }
        if io.emergency_stop() || (0..self.axes.len()).any(|axis| io.hard_limit(axis)) {
            return Err(Refusal::CausePersists);
        }
        self.latch.clear(seen);
        self.go_idle(io);
        Ok(())
    }
}
