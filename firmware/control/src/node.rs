//! The controller at the end of its serial link: the same code in the firmware, the native board and the tests.

use vergence_protocol::{
    BoardEvent, BoardInfo, BoardSession, MAX_FRAME, Microseconds, ReplyTo, Report, Request, ResetCause, SessionId,
    Status,
};

use crate::controller::{Controller, Event};
use crate::io::RigIo;

/// Shorter periods of the pose stream would be longer on the wire than in time (45 bytes at 921 600 baud).
const SHORTEST_STREAM_US: u64 = 1_000;

/// What a board says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// What kind of board, at most 16 bytes.
    pub board: heapless::String<16>,
    /// Firmware version.
    pub firmware: [u8; 3],
    /// Which build.
    pub build: u64,
    /// Unique id of the chip.
    pub uid: [u8; 12],
    /// Why it started.
    pub reset: ResetCause,
}

/// Session, controller and telemetry.
#[derive(Debug)]
pub struct Node {
    session: BoardSession,
    controller: Controller,
    identity: NodeIdentity,
    stream_period: u64,
    next_pose: Microseconds,
    pose_seq: u16,
}

impl Node {
    /// A node whose `boot` number differs from the last start's.
    #[must_use]
    pub fn new(controller: Controller, identity: NodeIdentity, boot: u32) -> Self {
        Self {
            session: BoardSession::new(boot),
            controller,
            identity,
            stream_period: 0,
            next_pose: Microseconds(0),
            pose_seq: 0,
        }
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// Takes bytes from the link.
    pub fn receive(&mut self, now: Microseconds, bytes: &[u8], io: &mut impl RigIo) {
        for &byte in bytes {
            match self.session.receive(now, byte) {
                Some(BoardEvent::Opened { .. }) => self.stream_period = 0,
                Some(BoardEvent::Request { reply_to, request, received_at }) => {
                    self.serve(now, reply_to, &request, received_at, io);
                }
                None => {}
            }
        }
    }

    fn serve(
        &mut self,
        now: Microseconds,
        to: ReplyTo,
        request: &Request,
        received: Microseconds,
        io: &mut impl RigIo,
    ) {
        let session = self.session.session().unwrap_or(SessionId(0));
        let reply = match request {
            Request::Heartbeat { session, lease_ms } => {
                self.controller.heartbeat(received, *session, *lease_ms);
                return;
            }
            Request::TimeProbe { t0 } => Report::TimeReply { t0: *t0, t1: received, t2: now },
            Request::GetInfo => Report::Info { to: 0, info: self.info() },
            Request::GetAxis { axis } => match self.controller.axis_info(usize::from(*axis)) {
                Some(info) => Report::Axis { to: 0, axis: *axis, info },
                None => refused(),
            },
            Request::SetStream { period_us } => {
                self.set_stream(now, u64::from(*period_us));
                Report::Ack { to: 0, status: Status::Accepted }
            }
            motion => Report::Ack { to: 0, status: self.controller.handle(now, session, motion, io) },
        };
        self.session.reply(to, reply);
        self.forward_events();
    }

    fn info(&self) -> BoardInfo {
        let NodeIdentity { board, firmware, build, uid, reset } = self.identity.clone();
        let axes = u8::try_from(self.controller.axis_count()).unwrap_or(u8::MAX);
        BoardInfo { board, firmware, build, uid, reset, axes }
    }

    fn set_stream(&mut self, now: Microseconds, period: u64) {
        self.stream_period = if period == 0 { 0 } else { period.max(SHORTEST_STREAM_US) };
        self.next_pose = now;
    }

    /// Runs the control tick and, where due, telemetry. Returns when it wants to run again.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) -> Microseconds {
        let next_tick = self.controller.poll(now, io);
        self.forward_events();
        if self.stream_period > 0 && now >= self.next_pose {
            self.pose_seq = self.pose_seq.wrapping_add(1);
            self.session.telemetry(self.controller.pose(now, self.pose_seq, io));
            // Whole periods, so that a late tick does not shift the stream.
            let late = (now.0 - self.next_pose.0) / self.stream_period + 1;
            self.next_pose = Microseconds(self.next_pose.0 + late * self.stream_period);
        }
        next_tick
    }

    fn forward_events(&mut self) {
        while let Some(event) = self.controller.take_event() {
            self.session.send(match event {
                Event::MoveState { id, phase } => Report::MoveState { id, phase },
                Event::Fault(record) => Report::Fault(record),
            });
        }
    }

    /// The next frame for the link; call until `None`.
    pub fn transmit(&mut self, now: Microseconds, buffer: &mut [u8; MAX_FRAME]) -> Option<usize> {
        self.session.transmit(now, buffer)
    }
}

fn refused() -> Report {
    Report::Ack { to: 0, status: Status::Refused(vergence_protocol::Refusal::Invalid) }
}
