//! Helpers that the session tests share.

#![allow(dead_code, reason = "each test file uses its part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

pub mod board;
pub mod rig;

use vergence_protocol::{
    AxisInfo, AxisKind, AxisList, AxisMask, BoardInfo, ControllerState, Micro, Microseconds, Mode, Move, MoveId,
    MovePhase, PROTOCOL, Permille, PoseReport, Refusal, Report, Request, ResetCause, SessionId, Status, schema_hash,
};

pub const SESSION: SessionId = SessionId(0x5EED);

pub fn move_to(id: u16) -> Request {
    let targets = AxisList::from_iter([Micro(i32::from(id)), Micro(-1)]);
    Request::MoveTo(Move { id: MoveId(id), mode: Mode(1), targets, speed: Permille::FULL })
}

pub fn pose(seq: u16) -> PoseReport {
    PoseReport {
        at: Microseconds(u64::from(seq)),
        seq,
        counts: AxisList::new(),
        referenced: AxisMask(3),
        state: ControllerState::Ready,
        mode: Mode(1),
        move_id: MoveId(0),
        phase: MovePhase::None,
        fault: None,
    }
}

/// A different answer for each request, so that a wrong one is seen. `to` is for the session to fill in.
pub fn answer(request: &Request) -> Report {
    match request {
        Request::MoveTo(order) if order.id.0 % 3 == 0 => {
            let axis = order.id.0.to_le_bytes()[0];
            Report::Ack { to: 0, status: Status::Refused(Refusal::OutsideLimits { axis }) }
        }
        Request::GetAxis { axis } => Report::Axis { to: 0, axis: *axis, info: axis_info() },
        Request::GetInfo => Report::Info { to: 0, info: board_info() },
        Request::TimeProbe { t0 } => Report::TimeReply { t0: *t0, t1: Microseconds(0), t2: Microseconds(0) },
        _ => Report::Ack { to: 0, status: Status::Accepted },
    }
}

pub fn axis_info() -> AxisInfo {
    AxisInfo {
        kind: AxisKind::Linear,
        min: Micro(0),
        max: Micro(200_000),
        speed: 1,
        acceleration: 2,
        jerk: 3,
        counts_per_unit: 4,
    }
}

pub fn board_info() -> BoardInfo {
    let board = "test".try_into().unwrap();
    BoardInfo { board, firmware: [1, 2, 3], build: 4, uid: [5; 12], reset: ResetCause::PowerOn, axes: 2 }
}

/// An answer without its `to`.
pub fn without_to(mut report: Report) -> Report {
    if let Report::Ack { to, .. } | Report::Info { to, .. } | Report::Axis { to, .. } = &mut report {
        *to = 0;
    }
    report
}

pub fn hello(session: SessionId) -> Request {
    Request::Hello { protocol: PROTOCOL, schema: schema_hash(), session }
}
