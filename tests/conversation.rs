//! A host and a board on one wire, in virtual time: the native board, or the firmware on the simulated chip.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::collections::HashMap;

use vergence_control::RigIo;
use vergence_plant::{NativeBoard, Plant};
use vergence_protocol::management::ManagementReport;
use vergence_protocol::{
    AxisMask, BoardInfo, Compatibility, ControllerState, FaultRecord, HostEvent, HostSession, Jog, MAX_FRAME, Micro,
    Microseconds, Mode, Move, MoveId, MovePhase, Permille, PoseReport, Report, Request, SessionId, Status, Ticket,
    TriggerMark,
};

pub const LEASE_MS: u16 = 100;
pub const BOTH: AxisMask = AxisMask::first(2);
const BEAT_US: u64 = 20_000;
/// How often the host looks at the wire.
const STEP_US: u64 = 1_000;
const POSE_PERIOD_US: u32 = 5_000;
/// How often steps are looked at while they are watched.
const SAMPLE_US: u64 = 100;

/// A board at the end of the wire, with its mechanics. Time counts from when it got power.
pub trait Wired {
    /// Runs the board until this time.
    fn advance(&mut self, to: Microseconds);
    /// Begins to send bytes to the board, now.
    fn receive(&mut self, bytes: &[u8]);
    /// Bytes that the board sent since the last call.
    fn transmit(&mut self) -> Vec<u8>;
    /// The mechanics.
    fn plant(&self) -> &Plant;
}

impl Wired for NativeBoard {
    fn advance(&mut self, to: Microseconds) {
        self.advance(to);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.receive(bytes);
    }

    fn transmit(&mut self) -> Vec<u8> {
        self.transmit()
    }

    fn plant(&self) -> &Plant {
        self.plant()
    }
}

pub struct Conversation<B> {
    pub board: B,
    pub host: HostSession,
    /// The host's clock.
    pub now: Microseconds,
    /// What the host's clock read when the board got power.
    pub board_start: u64,
    /// Whether answers are read in the step in which they were asked for, and poses are told apart by the board's clock,
    /// which runs with the host's. The firmware on the chip starts later and takes its time.
    pub is_prompt: bool,
    /// Whether the host runs at all; one that has crashed sends nothing.
    pub alive: bool,
    next_beat: u64,
    pub last_beat: Microseconds,
    replies: HashMap<Ticket, Report>,
    pub pose: Option<PoseReport>,
    pub phases: Vec<(MoveId, MovePhase)>,
    pub faults: Vec<FaultRecord>,
    /// Each state that a pose has shown, once in a row.
    pub states: Vec<ControllerState>,
    pub compatibility: Option<Compatibility>,
    /// How often the board was found to have started anew.
    pub lost: u32,
    pub marks: Vec<TriggerMark>,
    pub log: Vec<u8>,
    pub management: Vec<ManagementReport>,
    /// All bytes that the board sent.
    pub sent: Vec<u8>,
    /// When watched: the motors' steps, and when they were so many for the first time.
    pub watched_steps: Option<Vec<(Microseconds, [i32; 2])>>,
    next_move: u16,
}

impl<B: Wired> Conversation<B> {
    /// A board that has just got power, and a host that has not spoken yet; its clock reads `now`.
    pub fn with_board(board: B, now: Microseconds) -> Self {
        Self {
            board,
            host: HostSession::new(SessionId(0x5e55_1011)),
            now,
            board_start: 0,
            is_prompt: false,
            alive: true,
            next_beat: 0,
            last_beat: Microseconds(0),
            replies: HashMap::new(),
            pose: None,
            phases: Vec::new(),
            faults: Vec::new(),
            states: Vec::new(),
            compatibility: None,
            lost: 0,
            marks: Vec::new(),
            log: Vec::new(),
            management: Vec::new(),
            sent: Vec::new(),
            watched_steps: None,
            next_move: 0,
        }
    }

    /// Homes a board that is connected.
    pub fn arm_and_home(&mut self) {
        assert_eq!(self.arm(), Status::Accepted);
        assert_eq!(self.home(), Status::Accepted);
        self.wait_for(ControllerState::Ready);
    }

    /// A new host after the old one is gone.
    pub fn reconnect(&mut self, id: u32) {
        self.host = HostSession::new(SessionId(id));
        self.alive = true;
        self.connect();
    }

    /// Opens a session with telemetry, disarmed.
    pub fn connect(&mut self) {
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
        let asked = self.is_prompt.then_some(Microseconds(start - self.board_start));
        if asked.is_none() {
            // A pose may be on its way.
            self.wait(2_000);
            self.pose = None;
        }
        let is_new = |pose: &PoseReport| asked.is_none_or(|asked| pose.at >= asked);
        let reached = |talk: &Self| talk.pose.as_ref().is_some_and(|pose| is_new(pose) && pose.state == state);
        self.wait_until(&format!("{state} not reached"), reached);
        self.now.0 - start
    }

    fn step(&mut self) {
        let end = self.now.0 + STEP_US;
        while self.now.0 < end {
            self.now.0 += if self.watched_steps.is_some() { SAMPLE_US } else { STEP_US };
            self.board.advance(Microseconds(self.now.0 - self.board_start));
            self.sample();
        }
        self.receive();
        if self.alive {
            self.speak();
        }
        if self.is_prompt {
            self.receive();
        }
    }

    fn sample(&mut self) {
        let made = self.steps();
        if let Some(steps) = &mut self.watched_steps
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
            self.last_beat = self.now;
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(self.now, &mut frame) {
            self.board.receive(&frame[..length]);
        }
    }

    fn receive(&mut self) {
        let bytes = self.board.transmit();
        self.sent.extend_from_slice(&bytes);
        if !self.alive {
            return;
        }
        let mut events = Vec::new();
        self.host.receive(self.now, &bytes, |event| events.push(event));
        for event in events {
            match event {
                HostEvent::Opened { compatibility, .. } => self.compatibility = Some(compatibility),
                HostEvent::Lost { .. } => self.lost += 1,
                HostEvent::Reply { ticket, report } => drop(self.replies.insert(ticket, report)),
                HostEvent::Report(Report::Pose(pose)) => self.see(pose),
                HostEvent::Report(Report::MoveState { id, phase }) => self.phases.push((id, phase)),
                HostEvent::Report(Report::Fault(fault)) => self.faults.push(fault),
                HostEvent::Report(Report::TriggerMark(mark)) => self.marks.push(mark),
                HostEvent::Log(bytes) => self.log.extend(bytes),
                HostEvent::Management(report) => self.management.push(report),
                HostEvent::Report(other) => assert!(!self.is_prompt, "nobody asked for {other:?}"),
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

    pub fn move_to<const AXES: usize>(&mut self, targets: [i32; AXES], mode: u8) -> Status {
        self.next_move += 1;
        self.ask(Request::MoveTo(Move {
            id: MoveId(self.next_move),
            mode: Mode(mode),
            targets: targets.into_iter().map(Micro).collect(),
            speed: Permille::FULL,
        }))
    }

    /// Moves by a distance, in micrometres and microradians.
    pub fn jog<const AXES: usize>(&mut self, by: [i32; AXES]) -> Status {
        self.next_move += 1;
        let (id, by) = (MoveId(self.next_move), by.into_iter().map(Micro).collect());
        self.ask(Request::Jog(Jog { id, by, speed: Permille::FULL }))
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

    /// Steps that the motors have made.
    pub fn steps(&self) -> [i32; 2] {
        [0, 1].map(|axis| self.board.plant().steps(axis))
    }

    /// Where the loads truly are.
    pub fn loads(&self) -> [f64; 2] {
        self.board.plant().loads().try_into().expect("two axes")
    }
}
