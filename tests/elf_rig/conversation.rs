//! A host that talks to a board, and what it hears.

use std::collections::HashMap;

use vergence_control::RigIo;
use vergence_protocol::{
    AxisMask, BoardInfo, ControllerState, FaultRecord, HostEvent, HostSession, MAX_FRAME, Micro, Microseconds, Mode,
    Move, MoveId, MovePhase, Permille, PoseReport, Report, Request, SessionId, Status, Ticket,
};

use super::board::{Board, Standing};

pub const LEASE_MS: u16 = 100;
pub const BOTH: AxisMask = AxisMask::first(2);
const BEAT_US: u64 = 20_000;
/// How often the host looks at the wire.
const STEP_US: u64 = 1_000;
const POSE_PERIOD_US: u32 = 5_000;
/// How often steps are looked at while they are watched.
const SAMPLE_US: u64 = 100;

pub struct Conversation<B> {
    pub board: B,
    pub host: HostSession,
    /// Since the board got power.
    pub now: Microseconds,
    /// Whether the host runs at all; one that has crashed sends nothing.
    pub alive: bool,
    next_beat: u64,
    replies: HashMap<Ticket, Report>,
    pub pose: Option<PoseReport>,
    pub phases: Vec<(MoveId, MovePhase)>,
    pub faults: Vec<FaultRecord>,
    /// Each state that a pose has shown, once in a row.
    pub states: Vec<ControllerState>,
    /// How often the board was found to have started anew.
    pub lost: u32,
    pub log: Vec<u8>,
    /// When watched: the motors' steps, and when they were so many for the first time.
    pub steps: Option<Vec<(Microseconds, [i32; 2])>>,
    next_move: u16,
}

impl<B: Board> Conversation<B> {
    /// A board that has just got power, and a host that has not spoken yet.
    pub fn off(standing: &Standing) -> Self {
        Self {
            board: B::switched_on(standing),
            host: HostSession::new(SessionId(0x5e55_1011)),
            now: Microseconds(0),
            alive: true,
            next_beat: 0,
            replies: HashMap::new(),
            pose: None,
            phases: Vec::new(),
            faults: Vec::new(),
            states: Vec::new(),
            lost: 0,
            log: Vec::new(),
            steps: None,
            next_move: 0,
        }
    }

    /// A session with telemetry, disarmed.
    pub fn open(standing: &Standing) -> Self {
        let mut talk = Self::off(standing);
        talk.connect();
        talk
    }

    /// Armed and homed.
    pub fn homed(standing: &Standing) -> Self {
        let mut talk = Self::open(standing);
        assert_eq!(talk.arm(), Status::Accepted);
        assert_eq!(talk.home(), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        talk
    }

    /// A new host after the old one is gone.
    pub fn reconnect(&mut self, id: u32) {
        self.host = HostSession::new(SessionId(id));
        self.alive = true;
        self.connect();
    }

    fn connect(&mut self) {
        self.host.hello();
        self.wait_until("no answer to Hello", |talk| talk.host.is_open());
        self.next_beat = 0;
        assert_eq!(self.ask(Request::SetStream { period_us: POSE_PERIOD_US }), Status::Accepted);
        self.wait(2 * BEAT_US);
    }

    pub fn wait(&mut self, us: u64) {
        for _ in 0..us.div_ceil(STEP_US) {
            self.step();
        }
    }

    /// Waits for something, 20 s at most.
    pub fn wait_until(&mut self, or_else: &str, come: impl Fn(&Self) -> bool) {
        for _ in 0..20_000 {
            if come(self) {
                return;
            }
            self.step();
        }
        panic!("{or_else}: {:?}", self.pose);
    }

    /// Waits until the host hears `state`, in a pose that is not older than this call; returns how long it took, in
    /// microseconds.
    pub fn wait_for(&mut self, state: ControllerState) -> u64 {
        let start = self.now.0;
        // A pose may be on its way.
        self.wait(2_000);
        self.pose = None;
        let reached = |talk: &Self| talk.pose.as_ref().is_some_and(|pose| pose.state == state);
        self.wait_until(&format!("{state} not reached"), reached);
        self.now.0 - start
    }

    fn step(&mut self) {
        let end = self.now.0 + STEP_US;
        while self.now.0 < end {
            self.now.0 += if self.steps.is_some() { SAMPLE_US } else { STEP_US };
            self.board.advance(self.now);
            self.sample();
        }
        self.hear();
        if self.alive {
            self.speak();
        }
    }

    fn sample(&mut self) {
        let made = [0, 1].map(|axis| self.board.plant().steps(axis));
        if let Some(steps) = &mut self.steps
            && steps.last().is_none_or(|(_, last)| *last != made)
        {
            steps.push((self.now, made));
        }
    }

    fn speak(&mut self) {
        if self.host.is_open() && self.now.0 >= self.next_beat {
            let beat = Request::Heartbeat { session: self.host.id(), lease_ms: LEASE_MS };
            self.host.send_now(beat).expect("the line takes it");
            self.next_beat = self.now.0 + BEAT_US;
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(self.now, &mut frame) {
            self.board.receive(&frame[..length]);
        }
    }

    fn hear(&mut self) {
        let bytes = self.board.transmit();
        if !self.alive {
            return;
        }
        let mut events = Vec::new();
        self.host.receive(self.now, &bytes, |event| events.push(event));
        for event in events {
            match event {
                HostEvent::Lost { .. } => self.lost += 1,
                HostEvent::Reply { ticket, report } => drop(self.replies.insert(ticket, report)),
                HostEvent::Report(Report::Pose(pose)) => self.see(pose),
                HostEvent::Report(Report::MoveState { id, phase }) => self.phases.push((id, phase)),
                HostEvent::Report(Report::Fault(fault)) => self.faults.push(fault),
                HostEvent::Log(bytes) => self.log.extend(bytes),
                _ => {}
            }
        }
    }

    fn see(&mut self, pose: PoseReport) {
        if self.states.last() != Some(&pose.state) {
            self.states.push(pose.state);
        }
        self.pose = Some(pose);
    }

    /// Asks and waits for the answer.
    pub fn answer(&mut self, request: Request) -> Report {
        let ticket = match request {
            Request::Stop { .. } => self.host.send_now(request),
            _ => self.host.submit(self.now, request),
        };
        let ticket = ticket.expect("the session takes it");
        self.wait_until("no answer", |talk| talk.replies.contains_key(&ticket));
        self.replies.remove(&ticket).expect("it is there")
    }

    pub fn ask(&mut self, request: Request) -> Status {
        match self.answer(request) {
            Report::Ack { status, .. } => status,
            other => panic!("{other:?}"),
        }
    }

    pub fn info(&mut self) -> BoardInfo {
        match self.answer(Request::GetInfo) {
            Report::Info { info, .. } => info,
            other => panic!("{other:?}"),
        }
    }

    pub fn arm(&mut self) -> Status {
        let session = self.host.id();
        self.ask(Request::Arm { session })
    }

    pub fn home(&mut self) -> Status {
        self.ask(Request::Home { axes: BOTH })
    }

    pub fn move_to(&mut self, targets: [i32; 2], mode: u8) -> Status {
        self.next_move += 1;
        self.ask(Request::MoveTo(Move {
            id: MoveId(self.next_move),
            mode: Mode(mode),
            targets: targets.into_iter().map(Micro).collect(),
            speed: Permille::FULL,
        }))
    }

    /// Clears the fault that the latest pose shows.
    pub fn clear(&mut self) -> Status {
        self.wait(2 * u64::from(POSE_PERIOD_US));
        let seen = self.pose().fault.map_or(0, |fault| fault.seq);
        self.ask(Request::ClearFault { seen })
    }

    /// The latest telemetry.
    pub fn pose(&self) -> &PoseReport {
        self.pose.as_ref().expect("there is telemetry")
    }

    /// The latched fault in the latest telemetry; there must be one.
    pub fn fault(&self) -> FaultRecord {
        self.pose().fault.expect("a fault is latched")
    }

    /// Where the loads truly are.
    pub fn loads(&self) -> [f64; 2] {
        self.board.plant().loads().try_into().expect("two axes")
    }
}
