//! The control tick: watches inputs, decides, orders steps.

use vergence_protocol::{ControllerState, DriverState, EncoderState, FaultCode, Microseconds};

use super::Controller;
use crate::TICK_US;
use crate::axis::Axis;
use crate::follow::Lost;
use crate::homing_sequence::HomingFailure;
use crate::io::RigIo;
use crate::self_test::Verdict;

/// Latest time in microseconds after which a tick may come while steps are made. A board that starts the steps of a tick by
/// its interrupt lets the list of the tick before end meanwhile, which is late by as much.
const LATEST_US: u64 = 200;
impl Controller {
    /// Runs one control tick: watches inputs and lease, runs homing, moves and stops, orders the steps of the next tick.
    /// Returns the time of the next tick; earlier calls do nothing.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) -> Microseconds {
        if now < self.next_tick {
            return self.next_tick;
        }
        let tick = self.keep_time(now, io);
        self.next_tick = Microseconds(tick.0 + TICK_US);
        self.watch_inputs(now, io);
        self.watch_indices(now, io);
        self.watch_lease(now);
        match self.state {
            ControllerState::Boot => self.state = ControllerState::SelfTest,
            ControllerState::SelfTest => self.poll_self_test(now, io),
            ControllerState::Homing => self.poll_homing(now, io),
            ControllerState::Moving => self.poll_move(now, io),
            ControllerState::Stopping if !self.any_moving() => self.finish_stop(io),
            ControllerState::Idle => self.axes.iter_mut().for_each(|axis| axis.follow_encoder(io)),
            _ => {}
        }
        if self.drivers_on {
            self.count_planning();
            for axis in &mut self.axes {
                axis.advance(tick, io);
            }
            self.watch_following(now, io);
            self.watch_stalls(now, io);
        }
        // A plan begins ticks after its request, and a search with the next tick: the current is there before.
        let at_rest = self.drivers_on && self.planning.is_none() && !self.any_moving();
        self.holding.poll(now, at_rest, io);
        self.next_tick
    }

    /// The start of the tick that `now` belongs to.
    fn keep_time(&mut self, now: Microseconds, io: &mut impl RigIo) -> Microseconds {
        let late = now.0 - self.next_tick.0;
        self.allow_delay(now, late, io);
        if late < TICK_US { self.next_tick } else { now }
    }

    /// Judges a tick that comes `late` microseconds after its time: the steps of a tick begin with it, so that motors in
    /// mid-move stand still until then. More than 200 us is a fault. A board that calls [`Self::poll`] with the time
    /// at which a tick was due, not that at which it came, calls this before.
    pub fn allow_delay(&mut self, now: Microseconds, late: u64, io: &mut impl RigIo) {
        if late > LATEST_US && self.drivers_on && self.any_moving() {
            self.cut(now, FaultCode::TickMissed, None, i32::try_from(late).unwrap_or(i32::MAX), io);
        }
    }

    fn poll_self_test(&mut self, now: Microseconds, io: &impl RigIo) {
        if core::mem::take(&mut self.settings_lost) {
            self.state = ControllerState::Fault;
            return self.raise(now, FaultCode::BadSettings, None, 0);
        }
        match self.self_test.poll(self.axes.iter().map(|axis| &axis.settings), io) {
            Verdict::Running => {}
            Verdict::Passed => self.state = self.at_rest(),
            Verdict::Failed { code, axis, detail } => {
                self.state = ControllerState::Fault;
                self.raise(now, code, axis, detail);
            }
        }
    }

    fn watch_inputs(&mut self, now: Microseconds, io: &mut impl RigIo) {
        for axis in &mut self.axes {
            axis.read_limit(io);
        }
        if !self.drivers_on {
            return;
        }
        if io.emergency_stop() {
            self.cut(now, FaultCode::EmergencyStop, None, 0, io);
        } else if let Some(axis) = self.axes.iter().position(|axis| axis.limit().trips()) {
            self.cut(now, FaultCode::HardLimit, Some(axis), 0, io);
        } else {
            self.watch_drivers(now, io);
        }
    }

    /// A driver that is not usable any more cannot hold its axis, and without its encoder nobody knows where it is.
    fn watch_drivers(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let failed = (0..self.axes.len()).find_map(|axis| match io.driver(axis) {
            DriverState::Failed(code) => Some((axis, code)),
            _ => match self.encoder_state(axis, io) {
                EncoderState::Failed(code) => Some((axis, code)),
                _ => None,
            },
        });
        if let Some((axis, code)) = failed {
            self.cut_or_hold(now, axis, Lost { code, detail: 0 }, io);
        }
    }

    /// Ends all motion after an axis was lost. Stages are cut: where they are is not known any more. Joints are held, because a robot
    /// without torque would fall; each knows its angle, and the one that was lost rests where it is.
    fn cut_or_hold(&mut self, now: Microseconds, index: usize, Lost { code, detail }: Lost, io: &mut impl RigIo) {
        let Some(axis) = self.axes.get_mut(index).filter(|axis| axis.settings.is_joint()) else {
            return self.cut(now, code, Some(index), detail, io);
        };
        if !matches!(self.state, ControllerState::LinkLost | ControllerState::Fault) {
            axis.rest_at_encoder(io);
            self.fail_softly(now, code, index, detail);
        }
    }

    fn watch_lease(&mut self, now: Microseconds) {
        let Some(holder) = self.holder else { return };
        if self.is_latched() || self.lease.is_live(now, holder) {
            return;
        }
        let silence = i32::try_from(self.lease.silence(now)).unwrap_or(i32::MAX);
        self.brake();
        self.state = ControllerState::LinkLost;
        self.raise(now, FaultCode::LeaseExpired, None, silence);
    }

    fn watch_following(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let mut first = None;
        let homes = self.state == ControllerState::Homing;
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let lost = axis.watch(io).filter(|lost| !(homes && self.homing.takes(index, lost)));
            first = first.or(lost.map(|lost| (index, lost)));
        }
        if let Some((axis, lost)) = first {
            self.cut_or_hold(now, axis, lost, io);
        }
    }

    /// A stall that a driver reports in a move is a fault where the settings want it: the motor may have lost its place.
    fn watch_stalls(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let mut stalled = None;
        if self.state == ControllerState::Moving {
            for (index, axis) in self.axes.iter_mut().enumerate().filter(|(_, axis)| axis.settings.switches.stall_watch)
            {
                stalled = stalled.or(axis.reads_stall(io).then_some(index));
            }
        }
        if stalled.is_some() {
            self.cut(now, FaultCode::DriverStall, stalled, 0, io);
        }
    }

    /// Checks the counts at the index pulses. An axis whose count has drifted is off by a known small way, so that it is
    /// braked, and loses its reference.
    fn watch_indices(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let is_judged = !matches!(self.state, ControllerState::Updating | ControllerState::Trial);
        for index in 0..self.axes.len() {
            let lost = self.axes.get_mut(index).and_then(|axis| axis.watch_index(io));
            if let Some(lost) = lost.filter(|_| is_judged) {
                self.fail_softly(now, lost.code, index, lost.detail);
                self.axes.iter_mut().skip(index).take(1).for_each(Axis::forget_reference);
            }
        }
    }

    fn poll_homing(&mut self, now: Microseconds, io: &impl RigIo) {
        match self.homing.poll(&mut self.axes, io) {
            Ok(true) => self.state = ControllerState::Ready,
            Ok(false) => {}
            Err(HomingFailure { code, axis, detail }) => self.fail_softly(now, code, axis, detail),
        }
    }

    fn finish_stop(&mut self, io: &mut impl RigIo) {
        if self.disarm_at_rest {
            self.go_idle(io);
        } else {
            self.state = ControllerState::Ready;
        }
    }

    /// Raises a fault after which the axes are braked and held, with the references that they have.
    pub(super) fn fail_softly(&mut self, now: Microseconds, code: FaultCode, axis: usize, detail: i32) {
        self.brake();
        self.state = ControllerState::Fault;
        self.raise(now, code, Some(axis), detail);
    }

    /// Raises a fault after which positions are unknown: drivers off, references lost.
    fn cut(&mut self, now: Microseconds, code: FaultCode, axis: Option<usize>, detail: i32, io: &mut impl RigIo) {
        self.abort_motion();
        self.cut_drivers(io);
        self.axes.iter_mut().for_each(Axis::forget_reference);
        self.state = ControllerState::Fault;
        self.raise(now, code, axis, detail);
    }
}
