//! What the host asks of the board.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{AxisList, AxisMask, Micro, Microseconds, Mode, MoveId, Permille, ProtocolVersion, SessionId, SettingKey};

/// One request. Append only: the order is the wire format. `Hello` and `GetInfo` are frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// Opens a session; a new session id resets sequence numbers, starts the pose stream at its set period
    /// and switches the camera trigger off. Answered by `Report::Hello`.
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
    /// Go by a distance from here; without reference at homing speed, and then not further than the search for the
    /// home switch may go. For setting up by hand.
    Jog(Jog),
    /// What is this set to? Answered by `Report::Setting`.
    GetSetting(SettingKey),
    /// Set it; only while disarmed. Works at once and is forgotten at the next start unless saved.
    SetSetting {
        /// What.
        key: SettingKey,
        /// To what.
        value: i64,
    },
    /// Keep all settings through the next start; only while disarmed.
    SaveSettings,
    /// Back to the settings the firmware came with, not yet saved; only while disarmed.
    RestoreSettings,
    /// Fire the cameras.
    SetTrigger(Trigger),
    /// What did the flight recorder keep? Answered by `Report::Events`.
    GetEvents {
        /// Number of the first event wanted.
        first: u32,
    },
    /// How has the link been? Answered by `Report::Statistics`.
    GetStatistics,
}

/// A relative move, all axes together.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Jog {
    /// Chosen by the host; repeated in every Pose.
    pub id: MoveId,
    /// How far, for every axis.
    pub by: AxisList<Micro>,
    /// Share of the largest speed, as in [`Move`].
    pub speed: Permille,
}

/// What the camera trigger does. Each pulse latches the encoders and sends a `Report::FrameMark`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Trigger {
    /// Nothing.
    Off,
    /// One pulse, now.
    Once,
    /// A pulse every so many microseconds, the first one now.
    Every {
        /// Microseconds between two pulses.
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
