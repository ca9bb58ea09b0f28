//! Messages between host and controller board over the serial link (`no_std`, no allocation). `docs/protocol.md` explains
//! frames, sessions and versions by examples.
//!
//! A frame on the wire is `COBS(header | postcard body | CRC-32C) 0x00` ([`frame`]). The body is one [`Request`] (host to
//! board) or one [`Report`] (board to host). All numbers are integers: micrometres, microradians, counts, microseconds.
//!
//! Terms: an *axis* is one motor with its encoder; its *position* is in [`Micro`] units; *counts* are the encoder's
//! reading, zero at the axis zero once the axis is *referenced* (homed); the *lease* is the time that the board keeps going
//! without hearing from its host; a *mode* is a number to which the host gives a name (herbivore, human, ...).

#![no_std]

mod axis;
mod driver;
mod encoder;
mod fault;
pub mod frame;
mod identity;
pub mod management;
mod receiver;
mod recorder;
mod refusal;
mod report;
mod request;
mod session;
mod setting;
mod state;
mod units;
pub mod update;

pub use axis::{AxisInfo, AxisKind, AxisList, AxisMask, MAX_AXES};
pub use driver::DriverState;
pub use encoder::EncoderState;
pub use fault::{FaultCode, FaultRecord};
pub use frame::MAX_FRAME;
pub use identity::{BoardInfo, PROTOCOL, ProtocolVersion, ResetCause, schema_hash};
pub use receiver::{LinkCounters, Receiver};
pub use recorder::{EVENTS_PER_ANSWER, Happening, RecordedEvent, RecordedEvents, switch_text};
pub use refusal::{Refusal, Status};
pub use report::{PoseReport, Report, TriggerMark};
pub use request::{Jog, Move, Request, StopKind, Trigger};
pub use session::{
    BoardEvent, BoardSession, BoardStatistics, Compatibility, HostEvent, HostSession, HostStatistics, LOG_CHUNK,
    ReplyTo, SubmitError, Ticket, WINDOW,
};
pub use setting::{SettingItem, SettingKey};
pub use state::{ControllerState, MovePhase};
pub use units::{Counts, Micro, Microseconds, Mode, MoveId, Permille, SessionId};
