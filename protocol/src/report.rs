//! What the board tells the host.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    AxisInfo, AxisList, AxisMask, BoardStatistics, Counts, FaultCode, FaultRecord, Microseconds, Mode, MoveId,
    ProtocolVersion, RecordedEvents, SessionId, SettingKey,
};

/// One report. Append only: the order is the wire format. `Hello` and `Info` are frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Report {
    /// Answers `Request::Hello`.
    Hello {
        /// What the board speaks.
        protocol: ProtocolVersion,
        /// [`crate::schema_hash`] of the board.
        schema: u64,
        /// The session it answers.
        session: SessionId,
        /// Changes with every start of the board.
        boot: u32,
    },
    /// Answers `Request::GetInfo`.
    Info {
        /// Sequence number of the request.
        to: u8,
        /// The board.
        info: BoardInfo,
    },
    /// What became of a request that asked for no data.
    Ack {
        /// Sequence number of the request.
        to: u8,
        /// Done or refused.
        status: Status,
    },
    /// Answers `Request::TimeProbe`.
    TimeReply {
        /// As received.
        t0: Microseconds,
        /// When the probe arrived, board clock.
        t1: Microseconds,
        /// When this reply left, board clock.
        t2: Microseconds,
    },
    /// Answers `Request::GetAxis`.
    Axis {
        /// Sequence number of the request.
        to: u8,
        /// Index from 0.
        axis: u8,
        /// The axis.
        info: AxisInfo,
    },
    /// Telemetry: where the axes are, and everything that must not be missed.
    Pose(PoseReport),
    /// A move changed its phase.
    MoveState {
        /// Which move.
        id: MoveId,
        /// Where it is.
        phase: MovePhase,
    },
    /// A fault was latched.
    Fault(FaultRecord),
    /// Answers `Request::GetSetting`.
    Setting {
        /// Sequence number of the request.
        to: u8,
        /// What.
        key: SettingKey,
        /// Its value.
        value: i64,
    },
    /// Answers `Request::GetEvents`.
    Events {
        /// Sequence number of the request.
        to: u8,
        /// The events from the asked one on.
        events: RecordedEvents,
    },
    /// Answers `Request::GetStatistics`.
    Statistics {
        /// Sequence number of the request.
        to: u8,
        /// Since the board started.
        statistics: BoardStatistics,
    },
    /// The cameras were fired.
    FrameMark(FrameMark),
}

/// A camera trigger pulse.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct FrameMark {
    /// Counts pulses since the trigger was set.
    pub seq: u32,
    /// Its edge, board clock.
    pub at: Microseconds,
    /// Every encoder at the edge, as in a Pose.
    pub counts: AxisList<Counts>,
}

/// Telemetry. State, fault and move are repeated in each, so that one lost message never matters.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PoseReport {
    /// When the encoders were latched, board clock.
    pub at: Microseconds,
    /// Counts poses, so that the host sees losses.
    pub seq: u16,
    /// Every encoder, from the axis zero where referenced.
    pub counts: AxisList<Counts>,
    /// Which axes have found their reference.
    pub referenced: AxisMask,
    /// What the controller is doing.
    pub state: ControllerState,
    /// The mode reached, zero while on the way or elsewhere.
    pub mode: Mode,
    /// The latest move.
    pub move_id: MoveId,
    /// Where that move is.
    pub phase: MovePhase,
    /// The latched fault.
    pub fault: Option<FaultRecord>,
}

/// What the controller is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum ControllerState {
    /// Disarmed: drivers off.
    Idle,
    /// Armed, at rest.
    Ready,
    /// Looking for the reference.
    Homing,
    /// On the way to a target, or settling there.
    Moving,
    /// Decelerating on request.
    Stopping,
    /// The lease ran out: decelerating or at rest, latched until cleared.
    LinkLost,
    /// Latched until cleared.
    Fault,
    /// Starting.
    Boot,
    /// Checking encoders, switches and settings before anything may move.
    SelfTest,
    /// Taking a firmware image; nothing may move.
    Updating,
    /// A new firmware runs on trial; nothing may move until it is confirmed.
    Trial,
}

impl fmt::Display for ControllerState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Idle => "idle",
            Self::Ready => "ready",
            Self::Homing => "homing",
            Self::Moving => "moving",
            Self::Stopping => "stopping",
            Self::LinkLost => "link lost",
            Self::Fault => "fault",
            Self::Boot => "starting",
            Self::SelfTest => "self-test",
            Self::Updating => "taking firmware",
            Self::Trial => "firmware on trial",
        })
    }
}

/// Where a move is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum MovePhase {
    /// There has been none.
    None,
    /// The trajectory runs.
    Running,
    /// The trajectory is over; the encoder must stay inside the tolerance for a dwell.
    Settling,
    /// Reached, by the encoder.
    Settled,
    /// Stopped before it was reached.
    Stopped,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Status {
    /// Accepted; motion that it started is reported by `MoveState`.
    Accepted,
    /// Nothing was done, and why.
    Refused(Refusal),
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum Refusal {
    /// The controller is disarmed.
    NotArmed,
    /// Another session armed the board.
    WrongSession,
    /// There is no live lease: send a heartbeat first.
    NoLease,
    /// An axis has no reference: home first.
    NotReferenced {
        /// Which axis.
        axis: u8,
    },
    /// A target lies outside the limits. It is refused, not clamped.
    OutsideLimits {
        /// Which axis.
        axis: u8,
    },
    /// In motion: stop first, or wait.
    Busy,
    /// A fault or lost link is latched: clear it first.
    Latched,
    /// There is nothing to clear, or the fault named is not the latched one.
    WrongFault,
    /// The cause of the fault persists.
    CausePersists,
    /// No such axis, a wrong number of targets, or a speed of nothing.
    Invalid,
    /// The host speaks another schema of this protocol: reading only.
    ReadOnly,
    /// Only while disarmed.
    NotIdle,
    /// A new firmware is being taken or is on trial.
    Updating,
    /// The setting cannot have this value together with the others.
    BadSetting,
    /// There is no such setting on this board.
    NoSetting,
    /// The settings could not be written to flash; the old ones are still there.
    StorageFailed,
    /// The board is set to drive a machine that its firmware does not know.
    NoSuchMachine,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotArmed => f.write_str("the controller is disarmed: arm it first"),
            Self::WrongSession => f.write_str("another session holds the controller: wait until it disarms"),
            Self::NoLease => f.write_str("the board hears no heartbeat from this session"),
            Self::NotReferenced { axis } => write!(f, "axis {axis} has no reference: run 'vergence home' first"),
            Self::OutsideLimits { axis } => write!(f, "the target of axis {axis} lies outside its limits"),
            Self::Busy => f.write_str("the stages are in motion: wait or run 'vergence stop'"),
            Self::Latched => f.write_str("a fault is latched: see 'vergence status', then run 'vergence clear'"),
            Self::WrongFault => f.write_str("there is no such fault to clear"),
            Self::CausePersists => f.write_str("the cause of the fault is still there"),
            Self::Invalid => f.write_str("the request makes no sense to this board"),
            Self::ReadOnly => f.write_str("the board runs another protocol schema: it can be read but not moved"),
            Self::NotIdle => f.write_str("only while disarmed: run 'vergence disarm' first"),
            Self::Updating => f.write_str("a new firmware is being taken or is on trial"),
            Self::BadSetting => f.write_str("the setting cannot have this value beside the others"),
            Self::NoSetting => f.write_str("this board has no such setting"),
            Self::StorageFailed => f.write_str("the board could not write its flash: the old settings are still there"),
            Self::NoSuchMachine => f.write_str(
                "the board is set to drive the robot, which its firmware cannot yet: run 'vergence config set machine bench'",
            ),
        }
    }
}

/// The board. Frozen for ever: an update tool of any age must read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BoardInfo {
    /// What kind of board, such as `native-sim`.
    pub board: heapless::String<16>,
    /// Firmware version: major, minor, patch.
    pub firmware: [u8; 3],
    /// Which build.
    pub build: u64,
    /// Unique id of the chip.
    pub uid: [u8; 12],
    /// Why it last started.
    pub reset: ResetCause,
    /// How many axes it drives.
    pub axes: u8,
}

/// Why the board last started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum ResetCause {
    /// Power came.
    PowerOn,
    /// The reset pin or button.
    Pin,
    /// The firmware asked for it.
    Software,
    /// The watchdog bit.
    Watchdog,
}

impl Report {
    /// The sequence number of the request that this answers, where it answers one.
    #[must_use]
    pub fn to(&self) -> Option<u8> {
        match self {
            Self::Info { to, .. }
            | Self::Ack { to, .. }
            | Self::Axis { to, .. }
            | Self::Setting { to, .. }
            | Self::Events { to, .. }
            | Self::Statistics { to, .. } => Some(*to),
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
            | Self::Statistics { to, .. } => Some(to),
            _ => None,
        }
    }
}

impl PoseReport {
    /// The code of the latched fault.
    #[must_use]
    pub fn fault_code(&self) -> Option<FaultCode> {
        self.fault.map(|fault| fault.code)
    }
}
