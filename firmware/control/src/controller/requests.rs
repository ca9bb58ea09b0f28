//! Requests: each is carried out or refused with a reason; values are never clamped.

use vergence_protocol::{
    AxisList, AxisMask, ControllerState, DriverState, EncoderState, FaultCode, Jog, Micro, Microseconds, Mode, Move,
    MoveId, MovePhase, Permille, Refusal, Request, SessionId, Status, StopKind,
};

use super::{ActiveMove, Controller};
use crate::TICK_US;
use crate::axis::Axis;
use crate::homing_sequence::HomingSequence;
use crate::io::RigIo;

impl Controller {
    /// Carries out a request of `session` that concerns motion, or refuses it. Other requests are refused as
    /// [`Refusal::Invalid`].
    pub fn handle(&mut self, now: Microseconds, session: SessionId, request: &Request, io: &mut impl RigIo) -> Status {
        let outcome = match request {
            Request::Arm { session: named } if *named == session => self.arm(now, session, io),
            Request::Arm { .. } => Err(Refusal::WrongSession),
            Request::Disarm => self.disarm(io),
            Request::Home { axes } => self.home(now, session, *axes),
            Request::MoveTo(target) => self.move_to(now, session, target),
            Request::Jog(jog) => self.jog(now, session, jog, io),
            Request::Stop { kind } => {
                self.stop(*kind, io);
                Ok(())
            }
            Request::ClearFault { seen } => self.clear_fault(*seen, io),
            _ => Err(Refusal::Invalid),
        };
        outcome.map_or_else(Status::Refused, |()| Status::Accepted)
    }

    fn arm(&mut self, now: Microseconds, session: SessionId, io: &mut impl RigIo) -> Result<(), Refusal> {
        self.may_ever_move()?;
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
        (0u8..).take(self.axes.len()).try_for_each(|axis| match io.driver(axis.into()) {
            state if state.is_usable() => Ok(()),
            DriverState::Failed(code) => Err(Refusal::DriverNotReady { axis, why: Some(code) }),
            _ => Err(Refusal::DriverNotReady { axis, why: None }),
        })?;
        (0u8..).take(self.axes.len()).try_for_each(|axis| match self.encoder_state(axis.into(), io) {
            state if state.is_usable() => Ok(()),
            EncoderState::Failed(code) => Err(Refusal::EncoderNotReady { axis, why: Some(code) }),
            _ => Err(Refusal::EncoderNotReady { axis, why: None }),
        })?;
        for axis in &mut self.axes {
            axis.follow_encoder(io);
            axis.adopt_encoder(io);
        }
        // Ticks that were left out while the drivers were off do not count as missed.
        self.next_tick.0 += now.0.saturating_sub(self.next_tick.0).div_ceil(TICK_US) * TICK_US;
        self.holder = Some(session);
        self.drivers_on = true;
        io.set_drivers(true);
        self.state = ControllerState::Ready;
        Ok(())
    }

    fn disarm(&mut self, io: &mut impl RigIo) -> Result<(), Refusal> {
        match self.state {
            ControllerState::LinkLost | ControllerState::Fault => return Err(Refusal::Latched),
            ControllerState::Ready => self.go_idle(io),
            ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping => {
                self.disarm_at_rest = true;
                self.brake();
                self.state = ControllerState::Stopping;
            }
            _ => {}
        }
        Ok(())
    }

    /// Checks that the controller is in a state in which it can be armed.
    fn may_ever_move(&self) -> Result<(), Refusal> {
        match self.state {
            ControllerState::LinkLost | ControllerState::Fault => Err(Refusal::Latched),
            ControllerState::Updating | ControllerState::Trial => Err(Refusal::Updating),
            ControllerState::Boot | ControllerState::SelfTest => Err(Refusal::Busy),
            _ => Ok(()),
        }
    }

    /// Checks that `session` may start a motion now, or change the running one.
    fn may_move(&self, now: Microseconds, session: SessionId) -> Result<(), Refusal> {
        self.may_ever_move()?;
        match self.state {
            ControllerState::Idle => Err(Refusal::NotArmed),
            _ if self.holder != Some(session) => Err(Refusal::WrongSession),
            _ if !self.lease.is_live(now, session) => Err(Refusal::NoLease),
            ControllerState::Ready | ControllerState::Moving => Ok(()),
            _ => Err(Refusal::Busy),
        }
    }

    /// Checks that `session` may start a motion from rest.
    fn may_start(&self, now: Microseconds, session: SessionId) -> Result<(), Refusal> {
        self.may_move(now, session)?;
        if self.state == ControllerState::Ready { Ok(()) } else { Err(Refusal::Busy) }
    }

    /// Checks that no axis is at its hard limit.
    fn must_be_off_limits(&self) -> Result<(), Refusal> {
        match (0u8..).zip(&self.axes).find(|(_, axis)| axis.limit().is_reached()) {
            Some((axis, _)) => Err(Refusal::AtHardLimit { axis }),
            None => Ok(()),
        }
    }

    fn home(&mut self, now: Microseconds, session: SessionId, axes: AxisMask) -> Result<(), Refusal> {
        self.may_start(now, session)?;
        self.must_be_off_limits()?;
        if axes == AxisMask::default() || axes.0 & !AxisMask::first(self.axes.len()).0 != 0 {
            return Err(Refusal::Invalid);
        }
        let mut named = (0u8..).zip(&self.axes).filter(|(index, _)| axes.contains(usize::from(*index)));
        if let Some((axis, _)) = named.find(|(_, axis)| !axis.settings.switch_is_at_home()) {
            return Err(Refusal::HomeSwitchAside { axis });
        }
        self.homing = HomingSequence::start(axes, &mut self.axes);
        self.active.phase = MovePhase::None;
        self.state = ControllerState::Homing;
        Ok(())
    }

    /// Moves to a target, also in mid-move: from the present positions and speeds.
    fn move_to(&mut self, now: Microseconds, session: SessionId, order: &Move) -> Result<(), Refusal> {
        self.may_move(now, session)?;
        self.must_be_off_limits()?;
        self.check_order(order.targets.len(), order.speed)?;
        for (index, (axis, &position)) in (0u8..).zip(self.axes.iter().zip(&order.targets)) {
            if !axis.is_referenced() {
                return Err(Refusal::NotReferenced { axis: index });
            }
            if !axis.settings.allows(position) {
                return Err(Refusal::OutsideLimits { axis: index });
            }
        }
        self.begin(order.id, order.mode, order.targets.clone(), order.speed);
        Ok(())
    }

    /// Moves by a distance from rest. An axis without reference may move as far as the search for its switch, and one at its
    /// hard limit a short way off it. Such an axis has no reference, so that its speed is that of the search.
    fn jog(&mut self, now: Microseconds, session: SessionId, jog: &Jog, io: &impl RigIo) -> Result<(), Refusal> {
        self.may_start(now, session)?;
        self.check_order(jog.by.len(), jog.speed)?;
        let mut targets = AxisList::new();
        for (index, (axis, by)) in (0u8..).zip(self.axes.iter().zip(&jog.by)) {
            let target = Micro(axis.commanded().0.saturating_add(by.0));
            let allowed = match axis.is_referenced() {
                true => axis.settings.allows(target),
                false => by.0.unsigned_abs() <= axis.settings.homing.travel.0.unsigned_abs(),
            };
            if by.0 != 0 && !allowed {
                return Err(Refusal::OutsideLimits { axis: index });
            }
            if by.0 != 0 && !axis.limit_lets_go(*by, io) {
                return Err(Refusal::AtHardLimit { axis: index });
            }
            targets.push(target).map_err(|_| Refusal::Invalid)?;
        }
        self.begin(jog.id, Mode(0), targets, jog.speed);
        Ok(())
    }

    fn check_order(&self, axes: usize, speed: Permille) -> Result<(), Refusal> {
        let sound = axes == self.axes.len() && speed.0 > 0 && speed <= Permille::FULL;
        if sound { Ok(()) } else { Err(Refusal::Invalid) }
    }

    fn begin(&mut self, id: MoveId, mode: Mode, targets: AxisList<Micro>, speed: Permille) {
        self.abort_motion();
        let share = f32::from(speed.0) / f32::from(Permille::FULL.0);
        let (inside_since, rests_since, corrections) = (None, None, 0);
        let phase = MovePhase::Running;
        self.active = ActiveMove { id, mode, targets, share, phase, inside_since, rests_since, corrections };
        self.want_plan();
        self.state = ControllerState::Moving;
        self.queue_phase();
    }

    fn stop(&mut self, kind: StopKind, io: &mut impl RigIo) {
        match kind {
            StopKind::Decelerate => {
                if matches!(self.state, ControllerState::Homing | ControllerState::Moving) {
                    self.brake();
                    self.state = ControllerState::Stopping;
                }
            }
            StopKind::TorqueOff => {
                let moving = self.any_moving();
                self.abort_motion();
                if self.holder.is_some() && !self.is_latched() {
                    self.go_idle(io);
                } else {
                    self.cut_drivers(io);
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
        if io.emergency_stop() {
            return Err(Refusal::CausePersists);
        }
        // Whoever clears it knows of it; a limit reached behind another fault is a fault of its own when armed.
        if self.latch.record().is_some_and(|record| record.code == FaultCode::HardLimit) {
            self.axes.iter_mut().for_each(Axis::acknowledge_limit);
        }
        self.latch.clear(seen);
        self.go_idle(io);
        self.repeat_self_test();
        Ok(())
    }
}
