//! Requests: messages from the host to the board.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{AxisList, AxisMask, Micro, Microseconds, Mode, MoveId, Permille, ProtocolVersion, SessionId, SettingKey};

/// A request of the host. Append only: the order is the wire format. `Hello` and `GetInfo` are frozen for ever.
///
/// Requests that name no answer are answered by [`crate::Report::Ack`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Request {
    /// Opens a session. A new session id resets the sequence numbers, starts the pose stream at the period of the setting
    /// `stream_period_us`, and switches the camera trigger off. Answered by `Report::Hello`.
    Hello {
        /// Protocol version of the host.
        protocol: ProtocolVersion,
        /// [`crate::schema_hash`] of the host.
        schema: u64,
        /// Id of the session to open.
        session: SessionId,
    },
    /// Asks what board this is. Answered by `Report::Info`.
    GetInfo,
    /// Renews the lease of a session: the host is alive.
    Heartbeat {
        /// The session that armed the board.
        session: SessionId,
        /// Time until the lease expires unless it is renewed, in milliseconds.
        lease_ms: u16,
    },
    /// Asks for the board's time, to relate both clocks. Answered by `Report::TimeReply`.
    TimeProbe {
        /// Time at which the host sent the probe, host clock.
        t0: Microseconds,
    },
    /// Asks for limits and scale of an axis. Answered by `Report::Axis`.
    GetAxis {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// Switches the drivers on: Idle to Ready. Needs a lease of the same session that has not expired.
    Arm {
        /// The session that arms the board.
        session: SessionId,
    },
    /// Switches the drivers off: Ready to Idle, after deceleration if in motion. The reference is kept.
    Disarm,
    /// Searches the reference of some axes.
    Home {
        /// The axes to home.
        axes: AxisMask,
    },
    /// Moves to an absolute position.
    MoveTo(Move),
    /// Stops all motion. Needs neither arming nor a session.
    Stop {
        /// Kind of stop.
        kind: StopKind,
    },
    /// Clears a latched fault or lost link: to Idle, if the cause is gone.
    ClearFault {
        /// `seq` of the fault to clear, so that only a fault that the host has read can be cleared.
        seen: u16,
    },
    /// Sets the period of the pose stream.
    SetStream {
        /// Time between two poses in microseconds; 0 ends the stream.
        period_us: u32,
    },
    /// Moves by a distance, for setting up by hand. Without reference the speed is that of the search for the home switch,
    /// and the distance is at most that of the search. At a hard limit whose fault was cleared it is the only motion: away
    /// from the limit and at most `home_retract` beyond the place where it was met, or half as far in either direction where
    /// the axis was at rest then.
    Jog(Jog),
    /// Asks for a setting. Answered by `Report::Setting`.
    GetSetting(SettingKey),
    /// Changes a setting; only while disarmed. The change acts at once and is lost at the next start unless saved.
    SetSetting {
        /// The setting to change.
        key: SettingKey,
        /// New value of the setting.
        value: i64,
    },
    /// Saves all settings to flash; only while disarmed.
    SaveSettings,
    /// Returns to the firmware's default settings without saving them; only while disarmed.
    RestoreSettings,
    /// Sets the camera trigger.
    SetTrigger(Trigger),
    /// Asks for events of the flight recorder. Answered by `Report::Events`.
    GetEvents {
        /// Number of the first event wanted.
        first: u32,
    },
    /// Asks for figures of the link. Answered by `Report::Statistics`.
    GetStatistics,
    /// Asks for the state of the motor driver of an axis. Answered by `Report::Driver`.
    GetDriver {
        /// Index of the axis, from 0.
        axis: u8,
    },
    /// Asks whose firmware images the board takes. Answered by `Report::Key`.
    GetKey,
    /// Asks for the state of the encoder of an axis. Answered by `Report::Encoder`.
    GetEncoder {
        /// Index of the axis, from 0.
        axis: u8,
    },
}

/// A relative move of all axes together.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Jog {
    /// Number of the move, chosen by the host; repeated in every pose.
    pub id: MoveId,
    /// Distance for each axis.
    pub by: AxisList<Micro>,
    /// Share of each axis's largest speed, as in [`Move`].
    pub speed: Permille,
}

/// Program of the camera trigger. Each pulse latches the encoders and sends a `Report::TriggerMark`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Trigger {
    /// No pulses.
    Off,
    /// One pulse, now.
    Once,
    /// Pulses at a fixed period, the first one now.
    Every {
        /// Time between two pulses in microseconds.
        period_us: u32,
    },
}

/// An absolute move: all axes start and finish together.
///
/// ```
/// use vergence_protocol::{AxisList, Micro, Mode, Move, MoveId, Permille, Request};
///
/// // Baseline to 65 mm, separation to 0.5 rad, at half speed; no mode.
/// let targets = AxisList::from_iter([Micro(65_000), Micro(500_000)]);
/// let request = Request::MoveTo(Move { id: MoveId(1), mode: Mode(0), targets, speed: Permille(500) });
/// # let _ = request;
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Move {
    /// Number of the move, chosen by the host; repeated in every pose.
    pub id: MoveId,
    /// The mode that the targets stand for, or zero.
    pub mode: Mode,
    /// Target of each axis.
    pub targets: AxisList<Micro>,
    /// Share of each axis's largest speed. Acceleration scales with its square and jerk with its cube, so that the path
    /// keeps its shape.
    pub speed: Permille,
}

/// How to stop. Neither is an emergency stop: that is a switch wired to the drivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum StopKind {
    /// Decelerates within the limits of acceleration and jerk; the reference is kept.
    Decelerate,
    /// Switches the drivers off at once; the reference is lost if an axis was moving.
    TorqueOff,
}
