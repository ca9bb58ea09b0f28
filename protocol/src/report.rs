//! Reports: messages from the board to the host.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    AxisInfo, AxisList, AxisMask, BoardInfo, BoardStatistics, ControllerState, Counts, DriverState, EncoderState,
    FaultCode, FaultRecord, Microseconds, Mode, MoveId, MovePhase, ProtocolVersion, RecordedEvents, SessionId,
    SettingKey, Status,
};

/// A report of the board. Append only: the order is the wire format. `Hello` and `Info` are frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Report {
    /// Answers `Request::Hello`.
    Hello {
        /// Protocol version of the board.
        protocol: ProtocolVersion,
        /// [`crate::schema_hash`] of the board.
        schema: u64,
        /// The session of the request; zero if no session is open.
        session: SessionId,
        /// Number that changes with every start of the board.
        boot: u32,
    },
    /// Answers `Request::GetInfo`.
    Info {
        /// Sequence number of the request.
        to: u8,
        /// Description of the board.
        info: BoardInfo,
    },
    /// Answers a request that asked for no data.
    Ack {
        /// Sequence number of the request.
        to: u8,
        /// Accepted or refused.
        status: Status,
    },
    /// Answers `Request::TimeProbe`.
    TimeReply {
        /// `t0` of the probe, host clock.
        t0: Microseconds,
        /// Time at which the probe arrived, board clock.
        t1: Microseconds,
        /// Time at which this reply left, board clock.
        t2: Microseconds,
    },
    /// Answers `Request::GetAxis`.
    Axis {
        /// Sequence number of the request.
        to: u8,
        /// Index of the axis, from 0.
        axis: u8,
        /// Limits and scale of the axis.
        info: AxisInfo,
    },
    /// Telemetry: the encoders, and all state that the host must not miss.
    Pose(PoseReport),
    /// A move entered a phase.
    MoveState {
        /// Number of the move.
        id: MoveId,
        /// The phase entered.
        phase: MovePhase,
    },
    /// A fault was latched.
    Fault(FaultRecord),
    /// Answers `Request::GetSetting`.
    Setting {
        /// Sequence number of the request.
        to: u8,
        /// The setting.
        key: SettingKey,
        /// Value of the setting.
        value: i64,
    },
    /// Answers `Request::GetEvents`.
    Events {
        /// Sequence number of the request.
        to: u8,
        /// The events from the requested number on.
        events: RecordedEvents,
    },
    /// Answers `Request::GetStatistics`.
    Statistics {
        /// Sequence number of the request.
        to: u8,
        /// Figures since the board started.
        statistics: BoardStatistics,
    },
    /// The camera trigger fired.
    TriggerMark(TriggerMark),
    /// Answers `Request::GetDriver`.
    Driver {
        /// Sequence number of the request.
        to: u8,
        /// Index of the axis, from 0.
        axis: u8,
        /// State of its motor driver.
        state: DriverState,
    },
    /// Answers `Request::GetKey`.
    Key {
        /// Sequence number of the request.
        to: u8,
        /// Public key whose signatures the board trusts (Ed25519, RFC 8032).
        key: [u8; 32],
    },
    /// Answers `Request::GetEncoder`.
    Encoder {
        /// Sequence number of the request.
        to: u8,
        /// Index of the axis, from 0.
        axis: u8,
        /// State of its encoder.
        state: EncoderState,
    },
}

/// One pulse of the camera trigger.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TriggerMark {
    /// Number of the pulse since the trigger was set.
    pub seq: u32,
    /// Time of the rising edge, board clock.
    pub at: Microseconds,
    /// Counts of each encoder at the edge, as in [`PoseReport`].
    pub counts: AxisList<Counts>,
}

/// Telemetry: the encoders at one instant. Every pose repeats state, fault and move, so that a lost message does no harm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PoseReport {
    /// Time at which the encoders were read, board clock.
    pub at: Microseconds,
    /// Number of the pose, so that the host can count lost poses.
    pub seq: u16,
    /// Counts of each encoder: from the axis zero if the axis is referenced.
    pub counts: AxisList<Counts>,
    /// The axes that have a reference.
    pub referenced: AxisMask,
    /// State of the controller.
    pub state: ControllerState,
    /// The mode reached; zero on the way and elsewhere.
    pub mode: Mode,
    /// Number of the latest move.
    pub move_id: MoveId,
    /// Phase of the latest move.
    pub phase: MovePhase,
    /// The latched fault, if any.
    pub fault: Option<FaultRecord>,
}

impl Report {
    /// Sequence number of the request that this report answers, if it answers one.
    #[must_use]
    pub fn to(&self) -> Option<u8> {
        match self {
            Self::Info { to, .. }
            | Self::Ack { to, .. }
            | Self::Axis { to, .. }
            | Self::Setting { to, .. }
            | Self::Events { to, .. }
            | Self::Statistics { to, .. }
            | Self::Driver { to, .. }
            | Self::Key { to, .. }
            | Self::Encoder { to, .. } => Some(*to),
            _ => None,
        }
    }

    pub(crate) fn to_mut(&mut self) -> Option<&mut u8> {
        match self {
            Self::Info { to, .. }
            | Self::Ack { to, .. }
            | Self::Axis { to, .. }
            | Self::Setting { to, .. }
            | Self::Events { to, .. }
            | Self::Statistics { to, .. }
            | Self::Driver { to, .. }
            | Self::Key { to, .. }
            | Self::Encoder { to, .. } => Some(to),
            _ => None,
        }
    }
}

impl PoseReport {
    /// Code of the latched fault, if any.
    #[must_use]
    pub fn fault_code(&self) -> Option<FaultCode> {
        self.fault.map(|fault| fault.code)
    }
}
