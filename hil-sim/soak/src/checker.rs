//! The checker: observes the true mechanics, the bytes that reach the board, and the bytes that leave it.

use vergence_control::RigIo;
use vergence_plant::{Plant, Stage};
use vergence_protocol::{
    AxisMask, ControllerState, FaultRecord, Micro, Microseconds, Mode, MoveId, MovePhase, PoseReport, Receiver, Report,
    Request, SessionId,
};

use crate::faults::Fault;
use crate::journal::Journal;
use crate::promise::{EncoderReading, Promise, Violation};
use crate::watched_axis::WatchedAxis;

/// Time from the end of the lease to the tick that notices it, and from there to the check of its last step.
const NOTICE_US: u64 = 3_000;

/// States of a disarmed board.
const OFF: [ControllerState; 5] = [
    ControllerState::Idle,
    ControllerState::Boot,
    ControllerState::SelfTest,
    ControllerState::Updating,
    ControllerState::Trial,
];

#[derive(Debug)]
pub struct Checker {
    axes: Vec<WatchedAxis>,
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
    violations: Vec<Violation>,
}

impl Checker {
    pub fn new(stages: impl IntoIterator<Item = Stage>, faults: &[Fault], plant: &Plant, delay_us: u64) -> Self {
        let axes = stages.into_iter().enumerate().map(|(index, stage)| WatchedAxis::new(index, stage, faults, plant));
        Self {
            axes: axes.collect(),
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
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.steps = plant.steps(index);
        }
    }

    /// Checks the state after each millisecond.
    pub fn watch(&mut self, now: Microseconds, plant: &Plant) {
        let before = self.holder;
        self.watch_drivers(now, plant);
        // The motors may have stepped until the tick that cut the drivers.
        let holder = self.holder.or(before);
        for index in 0..self.axes.len() {
            let (steps, load) = (plant.steps(index), plant.load(index).unwrap_or_default());
            let axis = &mut self.axes[index];
            let made = steps.wrapping_sub(axis.steps);
            (axis.steps, axis.load) = (steps, load);
            axis.lost_at =
                (axis.reading == EncoderReading::Lost && plant.drivers_on()).then(|| axis.lost_at.unwrap_or(load));
            if let Some(what) = axis.check_hard_limit() {
                self.accuse(now, Promise::HardLimit, format!("axis {index}: {what}"));
            }
            if let Some(what) = self.axes[index].check_following() {
                self.accuse(now, Promise::Follows, format!("axis {index}: {what}"));
            }
            if made != 0 {
                self.check_step(now, index, holder);
                if !self.referenced.contains(index)
                    && let Some(what) = self.axes[index].check_gentle(made)
                {
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

    fn check_step(&mut self, now: Microseconds, axis: usize, holder: Option<SessionId>) {
        self.stepped_at = now.0;
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
            match request {
                Request::Heartbeat { session, lease_ms } => {
                    let end = now.0 + u64::from(lease_ms) * 1000;
                    self.leases.retain(|(named, _)| *named != session);
                    self.leases.push((session, end));
                }
                Request::Arm { session } => self.arm_asked = Some((session, now.0)),
                Request::ClearFault { seen } => self.clear_asked = Some(seen),
                Request::MoveTo(order) => {
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

    /// Checks a frame that leaves the board.
    pub fn received_from_board(&mut self, now: Microseconds, bytes: &[u8], plant: &Plant, journal: &mut Journal) {
        for &byte in bytes {
            let Some(frame) = self.from_board.push(byte) else { continue };
            match frame.body::<Report>() {
                Ok(Report::Pose(pose)) => self.check_pose(now, &pose, plant, journal),
                Ok(Report::Fault(record)) => {
                    journal.note(now, format!("board: {}: {record:?}", record.code));
                    self.check_fault(now, Some(record));
                }
                _ => {}
            }
        }
    }

    fn check_pose(&mut self, now: Microseconds, pose: &PoseReport, plant: &Plant, journal: &mut Journal) {
        if self.state.replace(pose.state) != Some(pose.state) {
            journal.note(now, format!("board: {}, loads {:.1?}", pose.state, plant.loads()));
        }
        let busy = matches!(pose.state, ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping);
        self.busy_since = if busy { self.busy_since.or(Some(now.0)) } else { None };
        self.referenced = pose.referenced;
        self.check_fault(now, pose.fault);
        self.check_state(now, pose, plant);
        if pose.mode != Mode(0)
            && let Some(what) = self.wrong_mode(pose)
        {
            self.accuse(now, Promise::Mode, what);
        }
        if std::mem::take(&mut self.restarted) {
            // The self-test may have found a fault since.
            let new_fault = pose.fault.is_none_or(|fault| fault.seq == 1 && fault.at <= pose.at);
            let fresh = pose.referenced == AxisMask(0) && pose.phase == MovePhase::None && new_fault;
            if !fresh {
                self.accuse(now, Promise::State, format!("remembers what was before its start: {pose:?}"));
            }
        }
    }

    /// Checks that the first fault stays unchanged until it is cleared by its number.
    fn check_fault(&mut self, now: Microseconds, reported: Option<FaultRecord>) {
        if let Some(first) = self.fault {
            let kept = reported.is_some_and(|reported| {
                reported.later >= first.later && FaultRecord { later: first.later, ..reported } == first
            });
            if !kept && self.clear_asked != Some(first.seq) {
                self.accuse(now, Promise::FirstFault, format!("{first:?} became {reported:?}"));
            }
        }
        self.fault = reported;
    }

    fn check_state(&mut self, now: Microseconds, pose: &PoseReport, plant: &Plant) {
        let latched = matches!(pose.state, ControllerState::LinkLost | ControllerState::Fault);
        if latched != pose.fault.is_some() {
            self.accuse(now, Promise::FirstFault, format!("state {} with fault {:?}", pose.state, pose.fault));
        }
        // While a fault is latched, the drivers may be on or off.
        let off = OFF.contains(&pose.state);
        let settled = now.0 >= self.switched_at + self.delay_us;
        if !latched && settled && off == plant.drivers_on() {
            let on = plant.drivers_on();
            self.accuse(now, Promise::State, format!("{} while drivers on is {on}", pose.state));
        }
    }

    /// Returns the contradiction to a reported mode; `None` where it is true.
    fn wrong_mode(&self, pose: &PoseReport) -> Option<String> {
        let Some((_, mode, targets)) = self.moves.iter().find(|(id, ..)| *id == pose.move_id) else {
            return Some(format!("mode {:?} of a move that nobody asked for", pose.mode));
        };
        if *mode != pose.mode {
            return Some(format!("mode {:?} of a move to {mode:?}", pose.mode));
        }
        let mut pairs = self.axes.iter().zip(targets).enumerate();
        pairs.find_map(|(index, (axis, target))| {
            let (off, allowed) = (axis.load - f64::from(target.0), axis.mode_tolerance());
            (off.abs() > allowed).then(|| format!("{mode:?} but axis {index} is off by {off:.1} of {allowed:.1}"))
        })
    }

    /// The checks at the end, long after the host has fallen silent.
    pub fn check_rest(&mut self, now: Microseconds) {
        if now.0.saturating_sub(self.stepped_at) < 100_000 {
            self.accuse(now, Promise::Ends, "still stepping at the end".into());
        }
    }
}
