//! What the host asks of the board.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{AxisList, AxisMask, Micro, Microseconds, Mode, MoveId, Permille, ProtocolVersion, SessionId};

/// One request. Append only: the order is the wire format. `Hello` and `GetInfo` are frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// Opens a session; a new session id resets sequence numbers and stops the telemetry stream. Answered by `Report::Hello`.
    Hello {
        /// What the host speaks.
        protocol: ProtocolVersion,
        /// [`crate::schema_hash`] of the host.
        schema: u64,
        /// The session from now on.
        session: SessionId,
    },
    /// Who are you? Answered by `Report::Info`.
    GetInfo,
    /// The host is alive: renews the lease of its session.
    Heartbeat {
        /// The session that armed the board.
        session: SessionId,
        /// How long the board may go without hearing from the host, in milliseconds.
        lease_ms: u16,
    },
    /// Clock exchange. Answered by `Report::TimeReply`.
    TimeProbe {
        /// When the host sent it, host clock.
        t0: Microseconds,
    },
    /// What is this axis? Answered by `Report::Axis`.
    GetAxis {
        /// Index from 0.
        axis: u8,
    },
    /// Idle to Ready: drivers on. Needs a live lease of the same session.
    Arm {
        /// The session that will hold the lease.
        session: SessionId,
    },
    /// Ready to Idle, keeping the reference; in motion it first decelerates.
    Disarm,
    /// Find the reference of these axes.
    Home {
        /// Which axes.
        axes: AxisMask,
    },
    /// Go to an absolute position.
    MoveTo(Move),
    /// Stop. Needs no arming and no session.
    Stop {
        /// How.
        kind: StopKind,
    },
    /// LinkLost or Fault to Idle, when the cause is gone.
    ClearFault {
        /// The `seq` of the fault being cleared: what nobody has seen cannot be cleared.
        seen: u16,
    },
    /// Send a Pose every `period_us`; 0 stops.
    SetStream {
        /// Microseconds between two poses.
        period_us: u32,
    },
}

/// An absolute move: all axes start and finish together.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Move {
    /// Chosen by the host; repeated in every Pose.
    pub id: MoveId,
    /// The mode this pose is, or zero.
    pub mode: Mode,
    /// Target of every axis.
    pub targets: AxisList<Micro>,
    /// Share of each axis's largest speed; acceleration and jerk scale with its square and cube, so that the path keeps its shape.
    pub speed: Permille,
}

/// How to stop. None of these is an emergency stop: that is a wire to the drivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum StopKind {
    /// Decelerate within the limits of acceleration and jerk; the reference is kept.
    Decelerate,
    /// Drivers off at once; the reference is lost if the stage was moving.
    TorqueOff,
}
