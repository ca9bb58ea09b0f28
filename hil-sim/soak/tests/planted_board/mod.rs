//! The native board with one planted fault: in its settings, its wiring, or its messages.

use vergence_control::{RigIo, StepSchedule};
use vergence_plant::{NativeBoard, Plant};
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{
    AxisList, ControllerState, MAX_FRAME, Micro, Microseconds, Mode, Move, MoveId, MovePhase, PROTOCOL, PoseReport,
    Receiver, Report, Request, ResetCause, SessionId, Status,
};
use vergence_soak::{Board, Scenario, stages};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    None,
    NoLeaseCheck,
    WeakBrakes,
    NoRangeCheck,
    RefusesNothing,
    NoSwitches,
    ModeFromSteps,
    LooseFollowingCheck,
    LatestFault,
    FaultForgotten,
    DriversStayOn,
    Creeps,
    RestartsWithMemory,
    StopsAnswering,
    MovesForEver,
    FastWithoutReference,
    ForgetsTheNewTarget,
}

pub struct PlantedBoard {
    board: NativeBoard,
    defect: Defect,
    heard: Receiver,
    said: Receiver,
    session: Option<SessionId>,
    modes: Vec<(MoveId, Mode)>,
    /// The target of the latest move from rest.
    targets: AxisList<Micro>,
    /// Offset of the clock since a pretended restart.
    clock_offset: u64,
}

impl PlantedBoard {
    pub fn new(scenario: &Scenario, defect: Defect) -> Self {
        let mut stages = stages();
        for stage in &mut stages {
            match defect {
                Defect::WeakBrakes => {
                    stage.settings.acceleration /= 5;
                    stage.settings.jerk /= 25;
                }
                Defect::NoRangeCheck => stage.settings.max.0 *= 2,
                Defect::NoSwitches => {
                    stage.mechanics.home_switch = -1e9;
                    stage.mechanics.hard_limits = [-1e9, 1e9];
                }
                Defect::FastWithoutReference => stage.settings.homing.seek_speed = stage.settings.speed,
                // The loosest check that the controller accepts.
                Defect::LooseFollowingCheck => {
                    stage.settings.following_error = Micro(stage.settings.homing.travel.0 / 25);
                }
                _ => {}
            }
        }
        let (settings, mechanics) = (stages.map(|stage| stage.settings), stages.map(|stage| stage.mechanics));
        Self {
            board: NativeBoard::standing_at(&settings, &mechanics, &scenario.positions, 1).unwrap(),
            defect,
            heard: Receiver::new(),
            said: Receiver::new(),
            session: None,
            modes: Vec::new(),
            targets: AxisList::new(),
            clock_offset: 0,
        }
    }

    /// Feeds the board a heartbeat that no host has sent.
    fn forge_heartbeat(&mut self) {
        let Some(session) = self.session else { return };
        let header = Header { major: PROTOCOL.major, kind: Kind::Immediate, seq: 0, ack: 0 };
        let mut buffer = [0; MAX_FRAME];
        let length = encode(header, &Request::Heartbeat { session, lease_ms: 100 }, &mut buffer).unwrap();
        self.board.receive(&buffer[..length]);
    }

    fn creep(&mut self) {
        let start = self.board.now();
        let plant = self.board.plant_mut();
        if !plant.drivers_on() {
            plant.set_drivers(true);
            let at_ns = std::iter::once(500_000).collect();
            plant.schedule_steps(0, &StepSchedule { start, forward: true, at_ns });
        }
    }

    /// The same move, with the target of the running one.
    fn to_the_old_target(&self, header: Header, request: &Request) -> Option<Vec<u8>> {
        let Request::MoveTo(order) = request else { return None };
        if self.board.state() != ControllerState::Moving {
            return None;
        }
        let order = Move { targets: self.targets.clone(), ..order.clone() };
        let mut buffer = [0; MAX_FRAME];
        let length = encode(header, &Request::MoveTo(order), &mut buffer).unwrap();
        Some(buffer[..length].to_vec())
    }

    fn listen(&mut self, request: &Request) {
        match request {
            Request::Heartbeat { session, .. } => self.session = Some(*session),
            Request::MoveTo(order) => {
                self.modes.push((order.id, order.mode));
                if self.board.state() != ControllerState::Moving {
                    self.targets = order.targets.clone();
                }
            }
            _ => {}
        }
    }

    fn distort(&self, report: &mut Report) {
        match (self.defect, report) {
            (Defect::RefusesNothing, Report::Ack { status, .. }) => *status = Status::Accepted,
            (_, Report::Pose(pose)) => self.distort_pose(pose),
            _ => {}
        }
    }

    fn distort_pose(&self, pose: &mut PoseReport) {
        match self.defect {
            Defect::ModeFromSteps if pose.phase == MovePhase::Settling => {
                let mode = self.modes.iter().rev().find(|(id, _)| *id == pose.move_id);
                // A jog has none.
                (pose.phase, pose.mode) = (MovePhase::Settled, mode.map_or(Mode(0), |(_, mode)| *mode));
            }
            Defect::LatestFault => {
                if let Some(fault) = &mut pose.fault {
                    fault.at = pose.at;
                }
            }
            Defect::FaultForgotten => pose.fault = None,
            Defect::MovesForEver if pose.phase == MovePhase::Settled => pose.state = ControllerState::Moving,
            _ => {}
        }
    }
}

impl Board for PlantedBoard {
    fn advance(&mut self, to: Microseconds) {
        self.board.advance(Microseconds(to.0 + self.clock_offset));
        match self.defect {
            Defect::NoLeaseCheck => self.forge_heartbeat(),
            Defect::Creeps => self.creep(),
            Defect::DriversStayOn => self.board.plant_mut().set_drivers(true),
            _ => {}
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        for chunk in bytes.split_inclusive(|&byte| byte == 0) {
            let (mut deaf, mut altered) = (false, None);
            for &byte in chunk {
                let Some(frame) = self.heard.push(byte) else { continue };
                let (header, kind, request) = (frame.header, frame.header.kind, frame.body::<Request>());
                deaf |= kind == Kind::Control && self.board.now().0 > 5_000_000;
                if let Ok(request) = request {
                    altered = self.to_the_old_target(header, &request);
                    self.listen(&request);
                }
            }
            match altered {
                Some(frame) if self.defect == Defect::ForgetsTheNewTarget => self.board.receive(&frame),
                _ if deaf && self.defect == Defect::StopsAnswering => {}
                _ => self.board.receive(chunk),
            }
        }
    }

    fn transmit(&mut self) -> Vec<u8> {
        let mut out = Vec::new();
        for byte in self.board.transmit() {
            let Some(frame) = self.said.push(byte) else { continue };
            let (header, body) = (frame.header, frame.body::<Report>());
            let mut buffer = [0; MAX_FRAME];
            let length = match body {
                Ok(mut report) => {
                    self.distort(&mut report);
                    encode(header, &report, &mut buffer)
                }
                Err(_) => encode(header, &(), &mut buffer),
            };
            out.extend(&buffer[..length.unwrap()]);
        }
        out
    }

    fn delay_tick(&mut self, us: u64) {
        self.board.delay_tick(us);
    }

    fn restart(&mut self, boot: u32, _now: Microseconds) {
        if self.defect == Defect::RestartsWithMemory {
            self.clock_offset = self.board.now().0;
        } else {
            self.board.restart(ResetCause::Watchdog, boot).unwrap();
        }
    }

    fn plant(&self) -> &Plant {
        self.board.plant()
    }

    fn with_plant(&mut self, act: &mut dyn FnMut(&mut Plant)) {
        act(self.board.plant_mut());
    }
}
