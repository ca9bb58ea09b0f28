//! The checker: observes the true mechanics, the bytes that reach the board, and the bytes that leave it.

mod reports;

use std::collections::VecDeque;

use vergence_control::RigIo;
use vergence_plant::{Plant, Stage};
use vergence_protocol::{
    AxisMask, ControllerState, FaultRecord, Micro, Microseconds, Mode, MoveId, Receiver, Request, SessionId, StopKind,
    TriggerMark,
};

use crate::board_clock::BoardClock;
use crate::faults::Fault;
use crate::promise::{EncoderReading, Promise, Violation};
use crate::pulses::Pulses;
use crate::settings_in_force::{AxisLimits, SettingsInForce};
use crate::watched_axis::WatchedAxis;

/// Time from the end of the lease to the tick that notices it, and from there to the check of its last step.
const NOTICE_US: u64 = 3_000;
/// Time for which the answer to a clock probe is awaited.
const PROBE_US: u64 = 1_000_000;

#[derive(Debug)]
pub struct Checker {
    axes: Vec<WatchedAxis>,
    settings: SettingsInForce,
    clock: BoardClock,
    pulses: Pulses,
    /// Reports of pulses that were not checked yet, and when they came.
    marks: VecDeque<(u64, TriggerMark)>,
    /// Arrivals of clock probes: the host's time in them, and the true time.
    probes: VecDeque<(Microseconds, u64)>,
    from_host: Receiver,
    from_board: Receiver,
    /// Latest heartbeat of each session, and the end of its lease.
    leases: Vec<(SessionId, u64)>,
    moves: Vec<(MoveId, Mode, Vec<Micro>)>,
    /// The session that asked to arm last, and when.
    arm_asked: Option<(SessionId, u64)>,
    holder: Option<SessionId>,
    drivers_on: bool,
    /// Time at which the drivers were switched last.
    switched_at: u64,
    /// Longest delay of the board: [`crate::Board::delay_us`].
    delay_us: u64,
    clear_asked: Option<u16>,
    fault: Option<FaultRecord>,
    /// Axes that claim to have a reference.
    referenced: AxisMask,
    /// Whether there was no pose since the restart.
    restarted: bool,
    state: Option<ControllerState>,
    busy_since: Option<u64>,
    stepped_at: u64,
    /// When the host requested a stop first, and which; until it requests a motion again.
    stop_asked: Option<(u64, StopKind)>,
    /// Since when the emergency stop is pressed.
    pressed_since: Option<u64>,
    violations: Vec<Violation>,
}

impl Checker {
    pub fn new(stages: impl IntoIterator<Item = Stage>, faults: &[Fault], plant: &Plant, delay_us: u64) -> Self {
        let axes = stages.into_iter().enumerate().map(|(index, stage)| WatchedAxis::new(index, stage, faults, plant));
        let axes: Vec<WatchedAxis> = axes.collect();
        Self {
            settings: SettingsInForce::new(
                axes.iter()
                    .map(|axis| axis.stage.settings)
                    .map(|axis| AxisLimits { speed: axis.speed, max: axis.max.0 }),
            ),
            axes,
            clock: BoardClock::default(),
            pulses: Pulses::default(),
            marks: VecDeque::new(),
            probes: VecDeque::new(),
            from_host: Receiver::new(),
            from_board: Receiver::new(),
            leases: Vec::new(),
            moves: Vec::new(),
            arm_asked: None,
            holder: None,
            drivers_on: false,
            switched_at: 0,
            delay_us,
            clear_asked: None,
            fault: None,
            referenced: AxisMask(0),
            restarted: true,
            state: None,
            busy_since: None,
            stepped_at: 0,
            stop_asked: None,
            pressed_since: None,
            violations: Vec::new(),
        }
    }

    pub fn into_violations(self) -> Vec<Violation> {
        self.violations
    }

    /// Reports a broken promise, each once.
    pub fn accuse(&mut self, at: Microseconds, promise: Promise, what: String) {
        if self.violations.iter().all(|violation| violation.promise != promise) {
            self.violations.push(Violation { at, promise, what });
        }
    }

    /// Records that an encoder fails, or works again.
    pub fn encoder_shows(&mut self, axis: usize, reading: EncoderReading) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.reading = reading;
            axis.misread |= reading != EncoderReading::Clear;
            axis.lost_at = None;
        }
    }

    /// Records a restart of the board: it is not armed, and has lost its state.
    pub fn restarted(&mut self, plant: &Plant) {
        (self.holder, self.fault, self.clear_asked, self.busy_since) = (None, None, None, None);
        self.drivers_on = plant.drivers_on();
        self.restarted = true;
        self.state = None;
        self.referenced = AxisMask(0);
        self.clock = BoardClock::default();
        self.pulses.forget();
        self.marks.clear();
        self.probes.clear();
        self.settings.restarted();
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.steps = plant.steps(index);
        }
    }

    /// Checks the state after each millisecond.
    pub fn watch(&mut self, now: Microseconds, plant: &Plant) {
        let before = self.holder;
        self.watch_drivers(now, plant);
        self.watch_stops(now, plant);
        self.pulses.watch(now, plant);
        self.check_pulses(now);
        // The motors may have stepped until the tick that cut the drivers.
        let holder = self.holder.or(before);
        for index in 0..self.axes.len() {
            let (steps, load) = (plant.steps(index), plant.load(index).unwrap_or_default());
            let axis = &mut self.axes[index];
            let made = steps.wrapping_sub(axis.steps);
            axis.steps = steps;
            axis.observe(load);
            axis.lost_at =
                (axis.reading == EncoderReading::Lost && plant.drivers_on()).then(|| axis.lost_at.unwrap_or(load));
            if let Some(what) = axis.check_hard_limit(self.referenced.contains(index)) {
                self.accuse(now, Promise::HardLimit, format!("axis {index}: {what}"));
            }
            // Homing gives an axis its reference outside the range.
            if self.referenced.contains(index)
                && self.state != Some(ControllerState::Homing)
                && let Some(limits) = self.settings.limits().get(index)
                && let Some(what) = self.axes[index].check_range(limits.max)
            {
                self.accuse(now, Promise::Range, format!("axis {index}: {what}"));
            }
            if let Some(what) = self.axes[index].check_following() {
                self.accuse(now, Promise::Follows, format!("axis {index}: {what}"));
            }
            if made != 0 {
                self.check_step(now, index, holder);
                if let Some(what) = self.axes[index].check_speed(made, self.speed_limit(index)) {
                    self.accuse(now, Promise::Gentle, format!("axis {index}: {what}"));
                }
            }
        }
        if let Some(since) = self.busy_since
            && now.0 - since > self.longest_motion_us()
        {
            self.accuse(now, Promise::Ends, format!("{:?} does not end", self.state));
        }
    }

    /// The largest speed of an axis: that of homing without a reference, because obstacles are unknown then.
    fn speed_limit(&self, axis: usize) -> u32 {
        let limit = self.settings.limits().get(axis).map_or(0, |limits| limits.speed);
        if self.referenced.contains(axis) { limit } else { limit.min(self.axes[axis].stage.settings.homing.seek_speed) }
    }

    fn watch_drivers(&mut self, now: Microseconds, plant: &Plant) {
        let was_on = std::mem::replace(&mut self.drivers_on, plant.drivers_on());
        if was_on != self.drivers_on {
            self.switched_at = now.0;
        }
        match (was_on, self.drivers_on) {
            (false, true) => {
                let in_time = |(_, at): &(SessionId, u64)| now.0 <= at + self.delay_us;
                let asked = self.arm_asked.take().filter(in_time).map(|(session, _)| session);
                self.holder = asked.filter(|&session| self.lease_end(session) > now.0);
                if self.holder.is_none() {
                    self.accuse(now, Promise::Armed, format!("drivers go on though armed by {asked:?}"));
                }
            }
            (_, false) => self.holder = None,
            (true, true) => {}
        }
    }

    /// Checks that emergency stop and stops without torque switch the drivers off.
    fn watch_stops(&mut self, now: Microseconds, plant: &Plant) {
        self.pressed_since = plant.emergency_stop().then(|| self.pressed_since.unwrap_or(now.0));
        let noticed = NOTICE_US + self.delay_us;
        let overdue = |since: u64| self.drivers_on && now.0 > since + noticed;
        let pressed = self.pressed_since.is_some_and(overdue);
        // A board may be armed again after a stop.
        let since = self.switched_at.saturating_sub(self.delay_us);
        let torque = matches!(self.stop_asked, Some((at, StopKind::TorqueOff)) if overdue(at) && since <= at);
        if pressed {
            self.accuse(now, Promise::EmergencyStop, "drivers stay on while it is pressed".into());
        }
        if torque {
            self.accuse(now, Promise::Stops, "drivers stay on after a stop without torque".into());
        }
    }

    fn check_step(&mut self, now: Microseconds, axis: usize, holder: Option<SessionId>) {
        self.stepped_at = now.0;
        if let Some((asked, _)) = self.stop_asked
            && now.0 > asked + self.longest_stop_us() + NOTICE_US + self.delay_us
        {
            let late = now.0 - asked;
            self.accuse(now, Promise::Stops, format!("axis {axis} steps {late} us after a stop was requested"));
        }
        let Some(holder) = holder else {
            return self.accuse(now, Promise::Armed, format!("axis {axis} steps though nobody has armed"));
        };
        let lease_end = self.lease_end(holder);
        if now.0 > lease_end + self.longest_stop_us() + NOTICE_US + self.delay_us {
            let late = now.0 - lease_end;
            self.accuse(now, Promise::Lease, format!("axis {axis} steps {late} us after the lease"));
        }
    }

    fn lease_end(&self, session: SessionId) -> u64 {
        self.leases.iter().find(|(named, _)| *named == session).map_or(0, |(_, end)| *end)
    }

    /// Worst-case braking time, v/a + 2a/j, of the slowest axis.
    fn longest_stop_us(&self) -> u64 {
        let stop = |axis: &WatchedAxis| {
            let settings = &axis.stage.settings;
            let [v, a, j] = [settings.speed, settings.acceleration, settings.jerk].map(f64::from);
            ((v / a + 2.0 * a / j) * 1e6).ceil() as u64
        };
        self.axes.iter().map(stop).max().unwrap_or(0)
    }

    /// Longest homing: twice the whole search, the slow approach, and a margin.
    fn longest_motion_us(&self) -> u64 {
        let motion = |axis: &WatchedAxis| {
            let homing = &axis.stage.settings.homing;
            let [travel, retract] = [homing.travel, homing.retract].map(|way| f64::from(way.0));
            let [seek, slow] = [homing.seek_speed, homing.approach_speed].map(f64::from);
            ((2.0 * travel / seek + 4.0 * retract / slow + 5.0) * 1e6) as u64
        };
        self.axes.iter().map(motion).sum()
    }

    /// Records bytes that reach the board.
    pub fn received_from_host(&mut self, now: Microseconds, bytes: &[u8]) {
        for &byte in bytes {
            let Some(frame) = self.from_host.push(byte) else { continue };
            let Ok(request) = frame.body::<Request>() else { continue };
            self.settings.requested(frame.header.seq, &request);
            match request {
                Request::TimeProbe { t0 } => {
                    self.probes.push_back((t0, now.0));
                    self.probes.retain(|(_, at)| now.0 - at < PROBE_US);
                }
                Request::Heartbeat { session, lease_ms } => {
                    let end = now.0 + u64::from(lease_ms) * 1000;
                    self.leases.retain(|(named, _)| *named != session);
                    self.leases.push((session, end));
                }
                // A host that repeats a stop gets no more time for it.
                Request::Stop { kind } => {
                    self.stop_asked.get_or_insert((now.0, kind));
                }
                Request::Home { .. } | Request::Jog(_) => self.stop_asked = None,
                Request::Arm { session } => self.arm_asked = Some((session, now.0)),
                Request::ClearFault { seen } => self.clear_asked = Some(seen),
                Request::MoveTo(order) => {
                    self.stop_asked = None;
                    self.moves.retain(|(id, ..)| *id != order.id);
                    self.moves.push((order.id, order.mode, order.targets.to_vec()));
                }
                _ => {}
            }
        }
    }

    /// Checks the board after it has processed them.
    pub fn received(&mut self, now: Microseconds, plant: &Plant) {
        self.watch_drivers(now, plant);
    }

    /// The checks at the end, long after the host has fallen silent.
    pub fn check_rest(&mut self, now: Microseconds) {
        if now.0.saturating_sub(self.stepped_at) < 100_000 {
            self.accuse(now, Promise::Ends, "still stepping at the end".into());
        }
    }
}
