//! Looks on at every tick and every request, and fails the test when a promise is broken.

use std::collections::VecDeque;

use vergence_control::{AxisSettings, Controller, FINE_BITS};
use vergence_protocol::{
    ControllerState, FaultRecord, Micro, Microseconds, MovePhase, PoseReport, Refusal, Request, SessionId, Status,
};

use super::ideal_rig::{IdealRig, per_micro};
use super::{TICK_US, longest_stop_us};

/// Accelerations are measured over this many ticks, so that the rounding of positions does not drown them.
const SPAN: usize = 8;
const DWELL_US: u64 = 50_000;

/// What was commanded of one axis, the latest tick last.
#[derive(Debug)]
struct Path {
    settings: AxisSettings,
    commanded: VecDeque<f64>,
    /// A command, and the steps that had been ordered then.
    base: (f64, i32),
    /// Where the running move may go.
    hull: Option<[f64; 2]>,
}

impl Path {
    fn restart(&mut self, at: f64, steps: i32) {
        self.commanded = std::iter::repeat_n(at, 3 * SPAN + 1).collect();
        self.base = (at, steps);
    }

    /// Takes a command and the steps ordered for it. An axis at rest may be set to where it is: that is no motion.
    fn push(&mut self, commanded: f64, steps: i32, step: f64) {
        let rests = (self.ago(0) - self.ago(1)).abs() < 1e-9;
        if rests && (commanded - self.ago(0)).abs() > f64::from(self.settings.speed) * 1e-6 {
            let made = f64::from(steps - self.base.1) * step - (self.ago(0) - self.base.0);
            assert!(made.abs() <= 1.001 * step, "a jump by {made}");
            self.restart(commanded, steps);
        }
        self.commanded.pop_front();
        self.commanded.push_back(commanded);
        let apart = f64::from(steps - self.base.1) * step - (commanded - self.base.0);
        assert!(apart.abs() <= 1.001 * step, "steps and command are {apart} apart");
    }

    /// Commanded position `ticks` ago.
    fn ago(&self, ticks: usize) -> f64 {
        self.commanded[self.commanded.len() - 1 - ticks]
    }

    fn moves(&self) -> bool {
        (self.ago(0) - self.ago(1)).abs() > 1e-9
    }

    /// Mean acceleration over `span` ticks up to `ago` ticks ago.
    fn acceleration(&self, span: usize, ago: usize) -> f64 {
        let seconds = (span as u64 * TICK_US) as f64 * 1e-6;
        (self.ago(ago) - 2.0 * self.ago(ago + span) + self.ago(ago + 2 * span)) / (seconds * seconds)
    }

    /// Rounding of one commanded position: 1/256, and single precision over the longest way.
    fn rounding(&self) -> f64 {
        1e-5 + f64::from(f32::EPSILON) * f64::from(self.settings.homing.travel.0)
    }

    fn check(&self, pose: &PoseReport) {
        let [v, a, j] = [self.settings.speed, self.settings.acceleration, self.settings.jerk].map(f64::from);
        let (tick, rounding) = (TICK_US as f64 * 1e-6, self.rounding());
        let speed = (self.ago(0) - self.ago(1)).abs() / tick;
        assert!(speed <= v * 1.001 + 2.0 * rounding / tick, "speed {speed} of {v}: {pose:?}");
        // A single jump shows at once; steady excess shows over the span.
        let sharp = self.acceleration(1, 0).abs();
        assert!(sharp <= a * 1.02 + 4.0 * rounding / tick.powi(2), "acceleration {sharp} of {a}: {pose:?}");
        let span = SPAN as f64 * tick;
        let noise = 4.0 * rounding / span.powi(2);
        let (now, before) = (self.acceleration(SPAN, 0), self.acceleration(SPAN, SPAN));
        assert!(now.abs() <= a * 1.001 + noise, "acceleration {now} of {a}: {pose:?}");
        let jerk = (now - before).abs() / span;
        assert!(jerk <= j * 1.01 + 2.0 * noise / span, "jerk {jerk} of {j}: {pose:?}");
        if let Some([low, high]) = self.hull {
            let at = self.ago(0);
            assert!((low - 0.01..=high + 0.01).contains(&at), "{at} outside of {low}..{high}: {pose:?}");
        }
    }

    /// How well homing can know the axis zero: the way of one tick, and two counts.
    fn reference_error(&self) -> f64 {
        let way = f64::from(self.settings.homing.approach_speed) * TICK_US as f64 * 1e-6;
        way + 2.0 / per_micro(self.settings.encoder()) + 1.0
    }
}

/// The controller's promises, kept apart from its code.
#[derive(Debug)]
pub struct Watch {
    paths: Vec<Path>,
    holder: Option<SessionId>,
    lease: (SessionId, u64),
    fault: Option<FaultRecord>,
    targets: Vec<Micro>,
    inside_since: Option<u64>,
    phase: MovePhase,
    state: ControllerState,
    longest_stop: u64,
}

impl Watch {
    pub fn new(settings: &[AxisSettings]) -> Self {
        let path = |&settings: &AxisSettings| Path { settings, commanded: VecDeque::new(), base: (0.0, 0), hull: None };
        Self {
            paths: settings.iter().map(path).collect(),
            holder: None,
            lease: (SessionId(0), 0),
            fault: None,
            targets: Vec::new(),
            inside_since: None,
            phase: MovePhase::None,
            state: ControllerState::Idle,
            longest_stop: settings.iter().map(longest_stop_us).max().unwrap_or(0),
        }
    }

    pub fn settings(&self) -> Vec<AxisSettings> {
        self.paths.iter().map(|path| path.settings).collect()
    }

    /// Whether any axis was commanded to move in the latest tick.
    pub fn moves(&self) -> bool {
        self.paths.iter().any(|path| path.commanded.len() > 1 && path.moves())
    }

    pub fn lease_ends(&self) -> u64 {
        self.lease.1
    }

    pub fn heartbeat(&mut self, now: Microseconds, session: SessionId, lease_ms: u16) {
        if is_latched(self.state) || self.holder.is_none_or(|holder| holder == session) {
            self.lease = (session, now.0 + u64::from(lease_ms) * 1000);
        }
    }

    fn lease_is_live(&self, now: Microseconds, session: SessionId) -> bool {
        self.lease.0 == session && now.0 < self.lease.1
    }

    pub fn tick(&mut self, now: Microseconds, controller: &Controller, rig: &mut IdealRig) {
        let pose = controller.pose(now, 0, rig);
        assert_eq!(rig.orders_without_drivers, 0, "steps without drivers: {pose:?}");
        let switched = std::mem::take(&mut rig.switched);
        for (index, (path, axis)) in self.paths.iter_mut().zip(&rig.axes).enumerate() {
            let command = commanded(controller, index);
            if switched || path.commanded.is_empty() || !rig.drivers {
                path.restart(command, axis.ordered);
            }
            if !rig.drivers {
                path.hull = None;
            }
            path.push(command, axis.ordered, axis.step());
            path.check(&pose);
        }
        self.check_motion(now, &pose, rig);
        self.check_fault(&pose);
        self.check_arrival(now, &pose, rig);
        if matches!(pose.state, ControllerState::Idle | ControllerState::Updating) {
            self.holder = None;
        }
        self.state = pose.state;
    }

    /// Motion needs drivers, a state that moves, and a live lease; without lease it ends in time.
    fn check_motion(&self, now: Microseconds, pose: &PoseReport, rig: &IdealRig) {
        let expired = self.holder.is_some_and(|holder| !self.lease_is_live(now, holder));
        if expired {
            assert!(is_latched(pose.state), "silence is not noticed: {pose:?}");
        }
        if pose.state == ControllerState::LinkLost && !is_latched(self.state) {
            assert!(expired, "the lease is alive: {pose:?}");
        }
        if !self.moves() {
            return;
        }
        assert!(rig.drivers && self.holder.is_some(), "motion of a disarmed rig: {pose:?}");
        assert!(!matches!(pose.state, ControllerState::Idle | ControllerState::Ready), "motion: {pose:?}");
        if expired {
            let bound = self.lease.1 + self.longest_stop + 2 * TICK_US;
            assert!(now.0 < bound, "still in motion {} us after the lease: {pose:?}", now.0 - self.lease.1);
        }
    }

    /// The first fault stays, later ones only count.
    fn check_fault(&mut self, pose: &PoseReport) {
        if let Some(first) = self.fault {
            let kept = pose.fault.unwrap();
            assert!(kept.later >= first.later, "{pose:?}");
            assert_eq!(FaultRecord { later: first.later, ..kept }, first);
        }
        // An update neither clears a fault nor needs one.
        if pose.state != ControllerState::Updating {
            assert_eq!(pose.fault.is_some(), is_latched(pose.state), "{pose:?}");
        }
        self.fault = pose.fault;
    }

    /// A mode is claimed by the encoder, never by the command.
    fn check_arrival(&mut self, now: Microseconds, pose: &PoseReport, rig: &IdealRig) {
        let slack = |path: &Path| path.reference_error() + f64::from(path.settings.tolerance.0);
        let inside =
            !self.targets.is_empty()
                && self.paths.iter().zip(&rig.axes).zip(&self.targets).all(|((path, axis), target)| {
                    (axis.load + axis.misread - f64::from(target.0)).abs() <= slack(path)
                });
        self.inside_since = if inside { self.inside_since.or(Some(now.0)) } else { None };
        if pose.mode.0 != 0 {
            assert!(inside && pose.phase == MovePhase::Settled, "mode claimed elsewhere: {pose:?}");
        }
        if pose.phase == MovePhase::Settled && self.phase != MovePhase::Settled && !self.targets.is_empty() {
            let since = self.inside_since.expect("settled outside of the tolerance");
            assert!(now.0 - since >= DWELL_US, "settled after {} us", now.0 - since);
        }
        self.phase = pose.phase;
    }

    pub fn asked(
        &mut self,
        now: Microseconds,
        (session, request, status): (SessionId, &Request, Status),
        controller: &Controller,
        rig: &IdealRig,
    ) {
        let pose = controller.pose(now, 0, rig);
        let foreign = self.holder.is_some_and(|holder| holder != session);
        match (request, status) {
            (Request::Arm { .. }, Status::Accepted) => {
                assert!(self.lease_is_live(now, session) && !is_latched(self.state) && !foreign, "{pose:?}");
                self.holder = Some(session);
            }
            (Request::Jog(jog), Status::Accepted) => {
                assert!(self.may_start(now, session), "{pose:?}");
                // Where a load is held back nobody can say where a motion by a distance ends.
                let held = rig.axes.iter().any(|axis| axis.blocked);
                let truth = rig.axes.iter().zip(&jog.by).filter(|_| !held);
                self.targets = truth.map(|(axis, by)| Micro((axis.load + f64::from(by.0)).round() as i32)).collect();
                self.inside_since = None;
                self.paths.iter_mut().for_each(|path| path.hull = None);
            }
            (Request::Home { .. }, Status::Accepted) => {
                assert!(self.may_start(now, session), "{pose:?}");
                self.paths.iter_mut().for_each(|path| path.hull = None);
            }
            (Request::MoveTo(order), Status::Accepted) => {
                assert!(self.may_move(now, session), "{pose:?}");
                assert_eq!(pose.referenced.0, 3);
                self.targets = order.targets.to_vec();
                self.inside_since = None;
                for (index, (path, target)) in self.paths.iter_mut().zip(&order.targets).enumerate() {
                    assert!((path.settings.min..=path.settings.max).contains(target), "{order:?}");
                    let (command, lowest) =
                        (commanded(controller, index), path.settings.min.0 - path.settings.backlash.0);
                    path.hull = Some([command.min(f64::from(lowest)), command.max(f64::from(path.settings.max.0))]);
                }
            }
            (Request::MoveTo(order), Status::Refused(Refusal::OutsideLimits { axis })) => {
                let (settings, target) = (self.paths[usize::from(axis)].settings, order.targets[usize::from(axis)]);
                assert!(!(settings.min..=settings.max).contains(&target));
            }
            (Request::ClearFault { seen }, Status::Accepted) => {
                assert_eq!(self.fault.map(|fault| fault.seq), Some(*seen));
                let off = matches!(pose.state, ControllerState::Idle | ControllerState::SelfTest);
                assert!(off && !rig.drivers, "{pose:?}");
                self.fault = None;
            }
            _ => {}
        }
        if matches!(pose.state, ControllerState::Idle | ControllerState::Updating) {
            self.holder = None;
        }
        self.state = pose.state;
        self.phase = pose.phase;
    }

    fn may_start(&self, now: Microseconds, session: SessionId) -> bool {
        self.state == ControllerState::Ready && self.may_move(now, session)
    }

    /// Also in mid-move.
    fn may_move(&self, now: Microseconds, session: SessionId) -> bool {
        matches!(self.state, ControllerState::Ready | ControllerState::Moving)
            && self.holder == Some(session)
            && self.lease_is_live(now, session)
    }
}

/// The last commanded position of an axis, in micro-units.
pub fn commanded(controller: &Controller, axis: usize) -> f64 {
    controller.command(axis).unwrap() as f64 / f64::from(1 << FINE_BITS)
}

fn is_latched(state: ControllerState) -> bool {
    matches!(state, ControllerState::LinkLost | ControllerState::Fault)
}
