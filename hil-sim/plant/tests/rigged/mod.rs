//! A host and a native board on one wire, in virtual time.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

use vergence_control::{AxisSettings, RigIo};
use vergence_plant::{AxisMechanics, NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::management::ManagementReport;
use vergence_protocol::{
    AxisMask, Compatibility, ControllerState, FaultRecord, FrameMark, HostEvent, HostSession, MAX_FRAME, Micro,
    Microseconds, Mode, Move, MoveId, MovePhase, Permille, PoseReport, Refusal, Report, Request, SessionId, Status,
    Ticket,
};

pub const LEASE_MS: u16 = 100;
pub const BOTH: AxisMask = AxisMask::first(2);
const BEAT_US: u64 = 20_000;
/// How often the wire is looked at.
const STEP_US: u64 = 1_000;
/// The host's instants lie between the board's ticks.
const OFFSET_US: u64 = 370;
const POSE_PERIOD_US: u32 = 5_000;

pub struct Rigged {
    pub board: NativeBoard,
    pub host: HostSession,
    /// The host's clock.
    pub now: Microseconds,
    /// What it read when the board was switched on.
    board_start: u64,
    /// Whether the host runs at all; one that has crashed sends nothing.
    pub alive: bool,
    next_beat: u64,
    pub last_beat: Microseconds,
    replies: Vec<(Ticket, Report)>,
    pub pose: Option<PoseReport>,
    pub phases: Vec<(MoveId, MovePhase)>,
    pub faults: Vec<FaultRecord>,
    pub compatibility: Option<Compatibility>,
    pub lost: bool,
    pub marks: Vec<FrameMark>,
    pub log: Vec<u8>,
    pub management: Vec<ManagementReport>,
    /// All bytes that the board sent.
    pub sent: Vec<u8>,
    next_move: u16,
}

impl Rigged {
    /// The bench, switched on, without a session.
    pub fn off(seed: u64) -> Self {
        Self::with(&bench_settings(), &bench_mechanics(), seed)
    }

    pub fn with(settings: &[AxisSettings], mechanics: &[AxisMechanics], seed: u64) -> Self {
        Self {
            board: NativeBoard::new(settings, mechanics, seed).unwrap(),
            host: HostSession::new(SessionId(0x5e55_1011)),
            now: Microseconds(OFFSET_US),
            board_start: 0,
            alive: true,
            next_beat: 0,
            last_beat: Microseconds(0),
            replies: Vec::new(),
            pose: None,
            phases: Vec::new(),
            faults: Vec::new(),
            compatibility: None,
            lost: false,
            marks: Vec::new(),
            log: Vec::new(),
            management: Vec::new(),
            sent: Vec::new(),
            next_move: 0,
        }
    }

    /// A session with telemetry, disarmed.
    pub fn open(mut self) -> Self {
        self.connect();
        self
    }

    /// Armed and homed.
    pub fn homed(seed: u64) -> Self {
        let mut rigged = Self::off(seed).open();
        assert_eq!(rigged.arm(), Status::Accepted);
        assert_eq!(rigged.home(), Status::Accepted);
        rigged.wait_for(ControllerState::Ready);
        rigged
    }

    fn connect(&mut self) {
        self.host.hello();
        while !self.host.is_open() {
            self.step();
        }
        let stream = self.ask(Request::SetStream { period_us: POSE_PERIOD_US });
        assert_eq!(stream, Status::Accepted);
        self.wait(2 * BEAT_US);
    }

    /// Switches the board off and on again.
    pub fn restart_board(&mut self, seed: u64) {
        self.board = NativeBoard::new(&bench_settings(), &bench_mechanics(), seed).unwrap();
        self.board_start = self.now.0 - OFFSET_US;
    }

    /// The board's clock began again at zero when the host's read `now`.
    pub fn board_starts(&mut self, now: Microseconds) {
        self.board_start = now.0;
    }

    /// A new host after the old one is gone.
    pub fn reconnect(&mut self, id: u32) {
        self.host = HostSession::new(SessionId(id));
        self.alive = true;
        self.next_beat = 0;
        self.connect();
    }

    pub fn wait(&mut self, us: u64) {
        for _ in 0..us.div_ceil(STEP_US) {
            self.step();
        }
    }

    /// Waits until the host hears `state`, 20 s at most; returns how long it took, in microseconds.
    pub fn wait_for(&mut self, state: ControllerState) -> u64 {
        let (start, asked) = (self.now.0, self.board.now());
        for _ in 0..20_000 {
            if self.pose.as_ref().is_some_and(|pose| pose.at >= asked && pose.state == state) {
                return self.now.0 - start;
            }
            self.step();
        }
        panic!("{state} not reached: {:?}", self.pose);
    }

    fn step(&mut self) {
        self.now.0 += STEP_US;
        self.board.advance(Microseconds(self.now.0 - self.board_start));
        self.hear();
        if self.alive {
            self.speak();
        }
        self.hear();
    }

    fn speak(&mut self) {
        if self.host.is_open() && self.now.0 >= self.next_beat {
            let beat = Request::Heartbeat { session: self.host.id(), lease_ms: LEASE_MS };
            self.host.send_now(beat).unwrap();
            self.next_beat = self.now.0 + BEAT_US;
            self.last_beat = self.now;
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(self.now, &mut frame) {
            self.board.receive(&frame[..length]);
        }
    }

    fn hear(&mut self) {
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
                HostEvent::Lost { .. } => self.lost = true,
                HostEvent::Reply { ticket, report } => self.replies.push((ticket, report)),
                HostEvent::Report(Report::Pose(pose)) => self.pose = Some(pose),
                HostEvent::Report(Report::MoveState { id, phase }) => self.phases.push((id, phase)),
                HostEvent::Report(Report::Fault(fault)) => self.faults.push(fault),
                HostEvent::Report(Report::FrameMark(mark)) => self.marks.push(mark),
                HostEvent::Log(bytes) => self.log.extend(bytes),
                HostEvent::Management(report) => self.management.push(report),
                HostEvent::Report(other) => panic!("{other:?}"),
            }
        }
    }

    /// Asks and waits for the answer.
    pub fn answer(&mut self, request: Request) -> Report {
        let ticket = match request {
            Request::Stop { .. } => self.host.send_now(request).unwrap(),
            _ => self.host.submit(self.now, request).unwrap(),
        };
        for _ in 0..500 {
            self.step();
            if let Some(index) = self.replies.iter().position(|(to, _)| *to == ticket) {
                return self.replies.swap_remove(index).1;
            }
        }
        panic!("no answer");
    }

    pub fn ask(&mut self, request: Request) -> Status {
        match self.answer(request) {
            Report::Ack { status, .. } => status,
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

    pub fn clear(&mut self) -> Status {
        self.wait(2 * u64::from(POSE_PERIOD_US));
        let seen = self.pose().fault.map_or(0, |fault| fault.seq);
        self.ask(Request::ClearFault { seen })
    }

    /// The latest telemetry.
    pub fn pose(&self) -> &PoseReport {
        self.pose.as_ref().unwrap()
    }

    /// The latched fault in the latest telemetry; there must be one.
    pub fn fault(&self) -> FaultRecord {
        self.pose().fault.unwrap()
    }

    /// Where the loads truly are.
    pub fn loads(&self) -> [f64; 2] {
        self.board.plant().loads().try_into().unwrap()
    }

    /// Steps that the motors have made.
    pub fn steps(&self) -> [i32; 2] {
        [0, 1].map(|axis| self.board.plant().steps(axis))
    }

    /// Refused for this reason.
    pub fn refused(why: Refusal) -> Status {
        Status::Refused(why)
    }
}
