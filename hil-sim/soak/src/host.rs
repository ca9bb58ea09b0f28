//! A scripted host: it executes its script, sends heartbeats, repeats requests, clears faults, and gives up in the end.
//! It never resumes motion by itself: every arm, home and move is requested anew.

use vergence_protocol::{
    AxisMask, ControllerState, FaultRecord, HostEvent, HostSession, Jog, MAX_FRAME, Microseconds, Move, MoveId,
    MovePhase, Permille, Refusal, Report, Request, SessionId, Status, StopKind, Ticket,
};

use crate::scenario::{Destination, Step};
use crate::stages::stages;

/// Lease of the host.
const LEASE_MS: u16 = 100;
const BEAT_US: u64 = 20_000;
const POSE_PERIOD_US: u32 = 10_000;
/// Silence of the board after which the host opens a new session.
const SILENCE_US: u64 = 300_000;
/// Time before a refused request is repeated.
const PAUSE_US: u64 = 100_000;
/// Time before a fault is cleared, less than a person needs to find and remove its cause.
const MEND_US: u64 = 300_000;
/// Milliseconds without an answer after which a request to a talking board counts as unanswered.
const PATIENCE: u32 = 6_000;
/// Limits after which the host gives up: faults cleared, sessions opened, requests for one step of the script.
const MOST_FAULTS: u32 = 4;
const MOST_SESSIONS: u32 = 30;
const MOST_REQUESTS: u32 = 60;

/// The content of the latest pose.
#[derive(Clone, Copy, Debug)]
struct Seen {
    state: ControllerState,
    referenced: bool,
    settled: Option<MoveId>,
    fault: Option<FaultRecord>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Stream,
    Arm,
    Home,
    Move(MoveId),
    /// A new target in mid-move.
    Turn(MoveId),
    Jog(MoveId),
    Forbidden,
    Clear,
    Disarm,
}

#[derive(Clone, Copy, Debug)]
struct Asked {
    ticket: Ticket,
    purpose: Purpose,
    turns: u32,
}

/// Ending of the script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostEnd {
    /// The script was completed.
    Done,
    /// Too many faults.
    GaveUp,
    /// The board sends frames but does not answer.
    Unanswered,
    /// The board accepted a request that it had to refuse.
    ForbiddenAccepted,
}

#[derive(Debug)]
pub struct Host {
    session: HostSession,
    script: Vec<Step>,
    step: usize,
    beat_due: Microseconds,
    /// When the session was opened, or the board last answered.
    last_report_at: Microseconds,
    streaming: bool,
    asked: Option<Asked>,
    seen: Option<Seen>,
    wait_until: Microseconds,
    /// The requests of the running step, and their answers.
    homed: bool,
    going: Option<MoveId>,
    stop_due: Option<Microseconds>,
    turn_due: Option<Microseconds>,
    turned: bool,
    next_move: u16,
    requests: u32,
    /// The fault that was handled last.
    mending: Option<u16>,
    faults: u32,
    sessions: u32,
    end: Option<HostEnd>,
    /// Journal entries not taken yet.
    pub notes: Vec<String>,
}

impl Host {
    pub fn new(script: Vec<Step>, now: Microseconds) -> Self {
        let mut host = Self {
            session: HostSession::new(SessionId(1)),
            script,
            step: 0,
            beat_due: Microseconds(0),
            last_report_at: now,
            streaming: false,
            asked: None,
            seen: None,
            wait_until: Microseconds(0),
            homed: false,
            going: None,
            stop_due: None,
            turn_due: None,
            turned: false,
            next_move: 0,
            requests: 0,
            mending: None,
            faults: 0,
            sessions: 0,
            end: None,
            notes: Vec::new(),
        };
        host.connect(now);
        host
    }

    /// Index of the present step of the script.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Ending of the script once it is over; the host is silent then.
    pub fn end(&self) -> Option<HostEnd> {
        self.end
    }

    /// Takes bytes from the board.
    pub fn receive(&mut self, now: Microseconds, bytes: &[u8]) {
        // One byte at a time: a byte ends one frame at most.
        for byte in bytes {
            let mut received = None;
            self.session.receive(now, std::slice::from_ref(byte), |event| received = Some(event));
            if let Some(event) = received {
                self.receive_event(now, event);
            }
        }
    }

    /// Runs the host for one millisecond: it decides what to do, and sends.
    pub fn turn(&mut self, now: Microseconds, mut send: impl FnMut(&[u8])) {
        if self.end.is_none() {
            self.keep_alive(now);
            self.decide(now);
        }
        let mut frame = [0; MAX_FRAME];
        while self.end.is_none_or(|end| end == HostEnd::GaveUp)
            && let Some(length) = self.session.transmit(now, &mut frame)
        {
            send(&frame[..length]);
        }
    }

    fn connect(&mut self, now: Microseconds) {
        self.sessions += 1;
        if self.sessions > MOST_SESSIONS {
            return self.give_up("no lasting session");
        }
        self.session = HostSession::new(SessionId(0x5e55_0000 + self.sessions));
        self.session.hello();
        self.last_report_at = now;
        self.streaming = false;
        self.asked = None;
        self.seen = None;
        // The requests belonged to the session that ended.
        self.homed = false;
    }

    fn keep_alive(&mut self, now: Microseconds) {
        if now.0.saturating_sub(self.last_report_at.0) > SILENCE_US {
            self.notes.push("host: the board is silent, calling again".into());
            self.connect(now);
        }
        if self.session.is_open() && now >= self.beat_due {
            let beat = Request::Heartbeat { session: self.session.id(), lease_ms: LEASE_MS };
            // Where the queue is full, another heartbeat is on its way.
            let _ = self.session.send_now(beat);
            self.beat_due = Microseconds(now.0 + BEAT_US);
        }
        if let Some(asked) = &mut self.asked {
            asked.turns += 1;
            if asked.turns > PATIENCE {
                self.notes.push(format!("host: no answer to {:?}", asked.purpose));
                self.end = Some(HostEnd::Unanswered);
            }
        }
    }

    fn decide(&mut self, now: Microseconds) {
        if !self.session.is_open() || self.asked.is_some() || self.end.is_some() {
            return;
        }
        if let Some(due) = self.stop_due
            && now >= due
        {
            self.notes.push("host: Stop".into());
            let _ = self.session.send_now(Request::Stop { kind: StopKind::Decelerate });
            // The session does not repeat it; a second one has the same effect as the first.
            self.stop_due = Some(Microseconds(now.0 + PAUSE_US));
        }
        if !self.streaming {
            return self.ask(now, Purpose::Stream, Request::SetStream { period_us: POSE_PERIOD_US });
        }
        if now < self.wait_until {
            return;
        }
        let Some(seen) = self.seen.take() else { return };
        if let Some(fault) = seen.fault {
            return self.clear(now, fault);
        }
        match self.script.get(self.step).copied() {
            None => self.finish(HostEnd::Done),
            Some(step) => self.pursue(now, step, seen),
        }
    }

    fn clear(&mut self, now: Microseconds, fault: FaultRecord) {
        (self.homed, self.stop_due, self.turn_due) = (false, None, None);
        if self.mending.replace(fault.seq) != Some(fault.seq) {
            self.wait_until = Microseconds(now.0 + MEND_US);
            return;
        }
        self.ask(now, Purpose::Clear, Request::ClearFault { seen: fault.seq });
    }

    /// Continues with a step, depending on the state of the board.
    fn pursue(&mut self, now: Microseconds, step: Step, seen: Seen) {
        if seen.state == ControllerState::Moving
            && let Step::Retarget(_, _, to) = step
            && self.turn_due.take_if(|due| *due <= now).is_some()
        {
            return self.ask_turn(now, to);
        }
        if !matches!(seen.state, ControllerState::Idle | ControllerState::Ready) {
            return;
        }
        let idle = seen.state == ControllerState::Idle;
        let session = self.session.id();
        match step {
            Step::MoveTooEarly(to) if idle || !seen.referenced => self.ask_move(now, Purpose::Forbidden, to),
            Step::MoveTooEarly(_) => self.next_step(),
            Step::Disarm if idle => self.next_step(),
            Step::Disarm => self.ask(now, Purpose::Disarm, Request::Disarm),
            Step::Pause(us) if self.going.is_none() => {
                self.going = Some(MoveId(0));
                self.wait_until = Microseconds(now.0 + us);
            }
            Step::Pause(_) => self.next_step(),
            _ if idle => self.ask(now, Purpose::Arm, Request::Arm { session }),
            Step::Arm => self.next_step(),
            Step::Home if self.homed && seen.referenced => self.next_step(),
            // Once only: several in sequence may end at a hard limit.
            Step::Jog(_) if self.going.is_some() => self.next_step(),
            Step::Jog(by) => {
                let id = self.name_move();
                let jog = Jog { id, by: by.into_iter().collect(), speed: Permille::FULL };
                self.ask(now, Purpose::Jog(id), Request::Jog(jog));
            }
            Step::Retarget(..) if self.turned && seen.settled == self.going => self.next_step(),
            Step::Retarget(_, _, to) if self.going.is_some() && seen.referenced => self.ask_turn(now, to),
            Step::MoveAndStop(..) if self.going.is_some() => self.next_step(),
            Step::Move(_) if self.going.is_some() && seen.settled == self.going => self.next_step(),
            Step::Move(to) | Step::MoveAndStop(to, _) | Step::Retarget(to, ..) if seen.referenced => {
                let id = self.name_move();
                self.ask_move(now, Purpose::Move(id), to);
            }
            Step::MoveTooFar(to) if seen.referenced => self.ask_move(now, Purpose::Forbidden, to),
            _ => self.ask(now, Purpose::Home, Request::Home { axes: AxisMask::first(stages().len()) }),
        }
    }

    fn name_move(&mut self) -> MoveId {
        self.next_move += 1;
        MoveId(self.next_move)
    }

    fn ask_turn(&mut self, now: Microseconds, to: Destination) {
        let id = self.name_move();
        self.ask_move(now, Purpose::Turn(id), to);
    }

    fn ask_move(&mut self, now: Microseconds, purpose: Purpose, to: Destination) {
        let id = if let Purpose::Move(id) | Purpose::Turn(id) = purpose { id } else { MoveId(u16::MAX) };
        let targets = to.targets.into_iter().collect();
        self.ask(now, purpose, Request::MoveTo(Move { id, mode: to.mode, targets, speed: to.speed }));
    }

    fn ask(&mut self, now: Microseconds, purpose: Purpose, request: Request) {
        self.requests += 1;
        if self.requests > MOST_REQUESTS {
            return self.give_up("no progress");
        }
        self.notes.push(format!("host: {request:?}"));
        match self.session.submit(now, request) {
            Ok(ticket) => self.asked = Some(Asked { ticket, purpose, turns: 0 }),
            Err(error) => self.notes.push(format!("host: {error}")),
        }
    }

    fn receive_event(&mut self, now: Microseconds, event: HostEvent) {
        if self.end.is_some() {
            return;
        }
        self.last_report_at = now;
        match event {
            HostEvent::Lost { boot } => {
                self.notes.push(format!("host: the session is lost, boot {boot}"));
                self.connect(now);
            }
            HostEvent::Reply { ticket, report: Report::Ack { status, .. } } => self.answered(now, ticket, status),
            HostEvent::Report(Report::Pose(pose)) => {
                self.seen = Some(Seen {
                    state: pose.state,
                    referenced: pose.referenced == AxisMask::first(stages().len()),
                    settled: (pose.phase == MovePhase::Settled).then_some(pose.move_id),
                    fault: pose.fault,
                });
            }
            HostEvent::Opened { .. } | HostEvent::Reply { .. } | HostEvent::Report(_) => {}
            HostEvent::Log(_) | HostEvent::Management(_) => {}
        }
    }

    fn answered(&mut self, now: Microseconds, ticket: Ticket, status: Status) {
        let Some(asked) = self.asked.take_if(|asked| asked.ticket == ticket) else { return };
        // Wait for a pose that is newer than the answer.
        self.seen = None;
        if let Status::Refused(why) = status {
            self.notes.push(format!("host: refused: {why}"));
            self.wait_until = Microseconds(now.0 + PAUSE_US);
        }
        match (asked.purpose, status) {
            (Purpose::Stream, _) => self.streaming = status == Status::Accepted,
            (Purpose::Home, _) => self.homed = status == Status::Accepted,
            (Purpose::Move(id), Status::Accepted) => {
                self.going = Some(id);
                match self.script.get(self.step) {
                    Some(Step::MoveAndStop(_, us)) => self.stop_due = Some(Microseconds(now.0 + us)),
                    Some(Step::Retarget(_, us, _)) => self.turn_due = Some(Microseconds(now.0 + us)),
                    _ => {}
                }
            }
            (Purpose::Turn(id), Status::Accepted) => (self.going, self.turned) = (Some(id), true),
            (Purpose::Jog(id), Status::Accepted) => self.going = Some(id),
            (Purpose::Jog(_), Status::Refused(Refusal::OutsideLimits { .. } | Refusal::AtHardLimit { .. })) => {
                self.next_step();
            }
            (Purpose::Forbidden, Status::Accepted) => self.finish(HostEnd::ForbiddenAccepted),
            (Purpose::Forbidden, Status::Refused(_)) => self.next_step(),
            (Purpose::Clear, Status::Accepted) => {
                self.mending = None;
                self.faults += 1;
                if self.faults > MOST_FAULTS {
                    self.give_up("too many faults");
                }
            }
            _ => {}
        }
    }

    fn next_step(&mut self) {
        self.step += 1;
        (self.homed, self.going, self.stop_due, self.requests) = (false, None, None, 0);
        (self.turned, self.turn_due) = (false, None);
        self.notes.push(match self.script.get(self.step) {
            Some(step) => format!("host: next is {step:?}"),
            None => "host: all done".into(),
        });
    }

    /// Ends, after switching the drivers off.
    fn give_up(&mut self, why: &str) {
        self.notes.push(format!("host: gives up, {why}"));
        let _ = self.session.send_now(Request::Stop { kind: StopKind::TorqueOff });
        self.finish(HostEnd::GaveUp);
    }

    fn finish(&mut self, end: HostEnd) {
        self.end = Some(end);
    }
}
