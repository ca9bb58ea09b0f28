//! The host of a robot's scenario: asks, waits, and goes to modes by planned paths, with everything else running beside it.

use std::collections::HashMap;

use vergence_board::straight_ways;
use vergence_protocol::{
    ControllerState, FaultRecord, HostEvent, HostSession, MAX_FRAME, Microseconds, Mode, Move, MoveId, MovePhase,
    PoseReport, Refusal, Report, Request, SessionId, Status, Ticket,
};
use vergence_rig::{AxisPosition, Rig};
use vergence_sim::DrivenTrunk;

use super::board::RobotBoard;
use super::checker::Checker;
use super::harm::HarmKind;
use crate::journal::Journal;

/// Period of host, checks and harm.
const TURN_US: u64 = 1_000;
const BEAT_US: u64 = 20_000;
const LEASE_MS: u16 = 100;
const POSE_PERIOD_US: u32 = 5_000;
/// The host's clock at the start.
const HOST_START_US: u64 = 10_000_000;
/// Longest time to an answer, to the end of a move, and until all joints are ready after a start.
const ANSWER_US: u64 = 2_000_000;
const MOVE_US: u64 = 20_000_000;
const READY_US: u64 = 6_000_000;

/// Why the host cannot go on.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Trouble {
    /// A fault is latched.
    Fault(FaultRecord),
    /// The board has started anew.
    Restarted,
    /// No path leads from where the robot stands.
    NoPath(String),
    /// Something did not happen in time, or was refused.
    Stuck(String),
}

/// A harm that is to begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub kind: HarmKind,
    pub axis: usize,
    pub at: Option<Microseconds>,
    /// When it began.
    pub began: Option<Microseconds>,
    pub is_over: bool,
    /// Loads on the joints while the board is armed.
    pub armed_loads: Option<[f64; 5]>,
}

/// The host, and the world that runs with it.
pub(super) struct RobotHost<'a, B> {
    pub rig: &'a Rig,
    pub board: &'a mut B,
    pub checker: Checker<'a>,
    pub journal: Journal,
    pub plan: Plan,
    pub now: Microseconds,
    session: HostSession,
    sessions: u32,
    /// True time of the board's start.
    board_start: u64,
    boots: u32,
    /// True time at which the clock in the board's messages began, once asked: that of the firmware, after its boot loader.
    clock_start: Option<u64>,
    pub alive: bool,
    /// Whether no path led back from where the robot stood.
    pub left_to_hands: bool,
    next_beat: u64,
    replies: HashMap<Ticket, Report>,
    pub pose: Option<PoseReport>,
    /// Limits of the board's axes, once asked.
    axes: Vec<vergence_protocol::AxisInfo>,
    lost: bool,
    next_move: u16,
}

impl<'a, B: RobotBoard> RobotHost<'a, B> {
    pub fn new(rig: &'a Rig, board: &'a mut B, plan: Plan) -> Self {
        Self {
            rig,
            board,
            checker: Checker::new(rig),
            journal: Journal::default(),
            plan,
            now: Microseconds(0),
            session: HostSession::new(SessionId(1)),
            sessions: 1,
            board_start: 0,
            boots: 1,
            clock_start: None,
            alive: true,
            left_to_hands: false,
            next_beat: 0,
            replies: HashMap::new(),
            pose: None,
            axes: Vec::new(),
            lost: false,
            next_move: 0,
        }
    }

    fn host_clock(&self) -> Microseconds {
        Microseconds(self.now.0 + HOST_START_US)
    }

    /// Lets a millisecond pass.
    pub fn step(&mut self) {
        self.now.0 += TURN_US;
        self.board.advance(Microseconds(self.now.0 - self.board_start));
        self.checker.watch(self.now, self.board.servos());
        self.harm();
        self.hear();
        if self.alive {
            self.speak();
        }
    }

    pub fn wait(&mut self, us: u64) {
        for _ in 0..us.div_ceil(TURN_US) {
            self.step();
        }
    }

    /// Begins the harm when it is due.
    fn harm(&mut self) {
        let Plan { kind, axis, at, began, .. } = self.plan;
        if began.is_some() || at.is_none_or(|at| self.now < at) {
            return;
        }
        self.plan.began = Some(self.now);
        self.journal.note(self.now, format!("{} on axis {axis}", kind.name()));
        kind.begin(self.board, axis);
        match kind {
            HarmKind::EmergencyStop => self.checker.forbid_torque(self.now),
            HarmKind::HostGone => self.alive = false,
            HarmKind::BoardRestart => self.restart_board(),
            HarmKind::PowerCut => {
                self.checker.forbid_torque(self.now);
                // Limp for a while; the board is without power as well.
                for _ in 0..1_000 {
                    self.now.0 += TURN_US;
                    self.board.advance(Microseconds(self.now.0 - self.board_start));
                    self.checker.watch(self.now, self.board.servos());
                }
                kind.end(self.board, axis);
                self.plan.is_over = true;
                self.restart_board();
            }
            _ => {}
        }
    }

    fn restart_board(&mut self) {
        self.boots += 1;
        self.board.restart(self.boots);
        self.board_start = self.now.0;
        self.board.transmit();
        self.pose = None;
        self.lost = true;
        // Its set-up of the servos switches their torque off; before, they hold by themselves.
        self.checker.allow_torque();
    }

    fn hear(&mut self) {
        let bytes = self.board.transmit();
        if !self.alive {
            return;
        }
        let mut events = Vec::new();
        self.session.receive(self.host_clock(), &bytes, |event| events.push(event));
        for event in events {
            match event {
                HostEvent::Lost { .. } => self.lost = true,
                HostEvent::Reply { ticket, report } => drop(self.replies.insert(ticket, report)),
                HostEvent::Report(Report::Pose(pose)) => self.see(pose),
                HostEvent::Report(Report::TimeReply { t0, t1, .. }) => {
                    self.clock_start = Some(t0.0.saturating_sub(HOST_START_US + t1.0));
                }
                HostEvent::Report(Report::Fault(fault)) => self.journal.note(self.now, format!("{fault:?}")),
                _ => {}
            }
        }
    }

    fn see(&mut self, pose: PoseReport) {
        let doubted = self.plan.began.filter(|_| self.plan.kind.is_of_joint()).map(|_| self.plan.axis);
        if let Some(start) = self.clock_start {
            self.checker.judge(self.now, Microseconds(start + pose.at.0), &pose, doubted);
        }
        self.pose = Some(pose);
    }

    fn speak(&mut self) {
        if self.session.is_open() && self.now.0 >= self.next_beat {
            // A full line takes the next one.
            let _ = self.session.send_now(Request::Heartbeat { session: self.session.id(), lease_ms: LEASE_MS });
            self.next_beat = self.now.0 + BEAT_US;
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.session.transmit(self.host_clock(), &mut frame) {
            self.board.receive(frame.get(..length).unwrap_or_default());
        }
    }

    /// Waits until something has come, for so long at most. A fault ends it.
    pub fn wait_until(&mut self, what: &str, longest_us: u64, come: impl Fn(&Self) -> bool) -> Result<(), Trouble> {
        let end = self.now.0 + longest_us;
        while self.now.0 < end {
            self.step();
            if self.lost {
                return Err(Trouble::Restarted);
            }
            if let Some(halt) = self.board.halted() {
                return Err(Trouble::Stuck(format!("the board works no more: {halt}")));
            }
            if come(self) {
                return Ok(());
            }
            if let Some(fault) = self.pose.as_ref().and_then(|pose| pose.fault) {
                return Err(Trouble::Fault(fault));
            }
            if !self.alive {
                return Err(Trouble::Stuck("the host is gone".into()));
            }
        }
        Err(Trouble::Stuck(format!("{what} did not come")))
    }

    /// Opens a session.
    pub fn connect(&mut self) -> Result<(), Trouble> {
        self.sessions += 1;
        self.session = HostSession::new(SessionId(self.sessions));
        (self.alive, self.lost, self.pose, self.clock_start) = (true, false, None, None);
        self.session.hello();
        self.wait_until("the session", ANSWER_US, |host| host.session.is_open())?;
        // It leaves in the next turn.
        let t0 = Microseconds(self.host_clock().0 + TURN_US);
        self.session.send_now(Request::TimeProbe { t0 }).map_err(|error| Trouble::Stuck(error.to_string()))?;
        self.wait_until("the board's time", ANSWER_US, |host| host.clock_start.is_some())?;
        self.ask(Request::SetStream { period_us: POSE_PERIOD_US })?;
        self.axes.clear();
        for axis in (0..=u8::MAX).take(self.rig.axes.len()) {
            if let Report::Axis { info, .. } = self.ask(Request::GetAxis { axis })? {
                self.axes.push(info);
            }
        }
        let begin = self.now.0;
        self.wait_until("a pose", ANSWER_US, |host| host.pose.is_some() && host.now.0 > begin)
    }

    fn ask(&mut self, request: Request) -> Result<Report, Trouble> {
        let text = format!("{request:?}");
        let stuck = |error: vergence_protocol::SubmitError| Trouble::Stuck(error.to_string());
        let ticket = self.session.submit(self.host_clock(), request).map_err(stuck)?;
        let had_fault = self.pose.as_ref().is_some_and(|pose| pose.fault.is_some());
        let begin = self.now.0;
        loop {
            match self.wait_until(&text, ANSWER_US, |host| host.replies.contains_key(&ticket)) {
                // A known fault does not end a question.
                Err(Trouble::Fault(_)) if had_fault && self.now.0 < begin + ANSWER_US => {}
                Err(trouble) => return Err(trouble),
                Ok(()) => break,
            }
        }
        self.replies.remove(&ticket).ok_or(Trouble::Stuck(text))
    }

    /// Asks for something that is carried out or refused.
    pub fn order(&mut self, request: &Request) -> Result<Status, Trouble> {
        match self.ask(request.clone())? {
            Report::Ack { status, .. } => {
                self.journal.note(self.now, format!("{request:?}: {status:?}"));
                Ok(status)
            }
            other => Err(Trouble::Stuck(format!("{request:?} is answered by {other:?}"))),
        }
    }

    /// Arms, as soon as all joints are ready.
    pub fn arm(&mut self) -> Result<(), Trouble> {
        let end = self.now.0 + READY_US;
        loop {
            self.checker.allow_torque();
            let status = self.order(&Request::Arm { session: self.session.id() })?;
            match status {
                Status::Accepted => {
                    self.load(self.plan.armed_loads);
                    return Ok(());
                }
                Status::Refused(
                    Refusal::DriverNotReady { .. }
                    | Refusal::EncoderNotReady { .. }
                    | Refusal::Busy
                    | Refusal::NoLease
                    | Refusal::NotReferenced { .. },
                ) if self.now.0 < end => self.wait(100_000),
                Status::Refused(why) => return Err(Trouble::Stuck(format!("arming is refused: {why}"))),
            }
        }
    }

    fn load(&mut self, loads: Option<[f64; 5]>) {
        let Some(loads) = loads else { return };
        self.board.with_servos(&mut |servos, _| {
            if let Some(driven) = servos.mechanism_mut().get_mut::<DrivenTrunk>() {
                driven.trunk_mut().set_loads(loads);
            }
        });
    }

    /// Disarms.
    pub fn disarm(&mut self) -> Result<(), Trouble> {
        self.load(self.plan.armed_loads.map(|_| [0.0; 5]));
        self.order(&Request::Disarm)?;
        self.wait_until("rest", MOVE_US, |host| {
            host.pose.as_ref().is_some_and(|pose| pose.state == ControllerState::Idle)
        })?;
        self.checker.forbid_torque(self.now);
        Ok(())
    }

    /// Goes to a mode by the ways that every host takes.
    pub fn go(&mut self, place: usize) -> Result<(), Trouble> {
        let mode = self.rig.modes.get(place).ok_or(Trouble::Stuck("no such mode".into()))?;
        // The latest pose may be older than the arming.
        let begin = self.now.0;
        self.wait_until("a pose", ANSWER_US, |host| host.pose.is_some() && host.now.0 >= begin + 10_000)?;
        let pose = self.pose.clone().ok_or(Trouble::Stuck("no pose".into()))?;
        let standing: Vec<AxisPosition> = self
            .rig
            .axes
            .iter()
            .zip(&pose.counts)
            .map(|(axis, counts)| AxisPosition::from_value(axis.kind, axis.value_at(f64::from(counts.0))))
            .collect();
        let ways = straight_ways(self.rig, &self.axes, &standing, &mode.targets)
            .map_err(|why| Trouble::NoPath(format!("no path to {}: {why}", mode.name)))?;
        self.journal.note(self.now, format!("to {} by {} ways", mode.name, ways.len()));
        let last = ways.len().saturating_sub(1);
        for (number, way) in ways.iter().enumerate() {
            let reported = if number == last { mode.number } else { Mode(0) };
            self.move_to(reported, &way.targets, way.speed)?;
        }
        Ok(())
    }

    fn move_to(
        &mut self,
        mode: Mode,
        targets: &[AxisPosition],
        speed: vergence_protocol::Permille,
    ) -> Result<(), Trouble> {
        self.next_move = self.next_move.wrapping_add(1).max(1);
        let id = MoveId(self.next_move);
        let targets = self.rig.wire_targets(targets);
        match self.order(&Request::MoveTo(Move { id, mode, targets, speed }))? {
            // A fault latched on the way of the order: the next pose tells which.
            Status::Accepted | Status::Refused(Refusal::Latched) => {}
            status => return Err(Trouble::Stuck(format!("the move is answered by {status:?}"))),
        }
        self.wait_until("the end of the move", MOVE_US, |host| {
            host.pose.as_ref().is_some_and(|pose| pose.move_id == id && pose.phase == MovePhase::Settled)
        })
    }

    /// Clears the latched fault.
    pub fn clear(&mut self) -> Result<(), Trouble> {
        let Some(seen) = self.pose.as_ref().and_then(|pose| pose.fault).map(|fault| fault.seq) else { return Ok(()) };
        // Clearing disarms.
        self.checker.end_hold();
        match self.order(&Request::ClearFault { seen })? {
            Status::Accepted => {}
            status => return Err(Trouble::Stuck(format!("clearing is answered by {status:?}"))),
        }
        self.checker.forbid_torque(self.now);
        // A pose from before may still show it.
        self.wait(20_000);
        Ok(())
    }
}
