//! The serial language between host and controller board (`no_std`, no allocation).
//!
//! A frame on the wire is `COBS(header | postcard body | CRC-32C) 0x00` ([`frame`]). The body is one [`Request`] (host to
//! board) or one [`Report`] (board to host). Only integers travel: micrometres, microradians, counts, microseconds.
//!
//! Terms: an *axis* is one motor with its encoder; its *position* is in [`Micro`] units; *counts* are what the encoder
//! read, zero at the axis zero once *referenced* (homed); a *lease* is how long the board trusts a silent host; a *mode* is
//! a number to which the host gives a name (herbivore, human, ...).

#![no_std]

mod axis;
mod fault;
pub mod frame;
pub mod management;
mod receiver;
mod recorder;
mod report;
mod request;
mod session;
mod setting;
mod units;
pub mod update;
mod version;

pub use axis::{AxisInfo, AxisKind, AxisList, AxisMask, MAX_AXES};
pub use fault::{FaultCode, FaultRecord};
pub use frame::MAX_FRAME;
pub use receiver::{LinkCounters, Receiver};
pub use recorder::{EVENTS_PER_ANSWER, Happening, RecordedEvent, RecordedEvents};
pub use report::{BoardInfo, ControllerState, FrameMark, MovePhase, PoseReport, Refusal, Report, ResetCause, Status};
pub use request::{Jog, Move, Request, StopKind, Trigger};
pub use session::{
    BoardEvent, BoardSession, BoardStatistics, Compatibility, HostEvent, HostSession, HostStatistics, LOG_CHUNK,
    ReplyTo, SubmitError, Ticket, WINDOW,
};
pub use setting::{SettingItem, SettingKey};
pub use units::{Counts, Micro, Microseconds, Mode, MoveId, Permille, SessionId};
pub use version::{PROTOCOL, ProtocolVersion, schema_hash};
