//! Talks to the controller board over a serial port, TCP or an in-process pipe.
//!
//! [`Client`] holds one protocol session over an open wire, and [`Board`] drives a rig through it: settings, homing, moves.
//! [`ManagementLink`] sends the requests that need no session, and [`update()`] brings new firmware into the board with them.
//! [`MovePlan`] shows a move before it is made. [`serve()`] is the other end of a wire: it runs a simulated board at the pace
//! of the clock. All errors are typed and carry a sentence that says what, where, and what to do.

mod board;
mod error;
mod link;
mod link_figures;
mod move_plan;
mod serve;
mod setting_text;
mod update;

pub use board::{Board, RecordedEvents, check_range, describe_fault, describe_pose, positions, staying};
pub use error::BoardError;
pub use link::{
    BoardKnowledge, Client, Followed, Follower, HostClock, LinkError, ManagementLink, OpenError, OpenWire, Port,
    PortLock, ReaderMark, RepeatedStop, Wire, fresh_session, is_held, is_wanted, open,
};
pub use link_figures::LinkFigures;
pub use move_plan::{AxisLimits, AxisPlan, Knot, MovePlan, MoveStart};
pub use serve::{BoardGuard, ListenError, Listener, ServeError, Served, Shared, serve, spawn_in_process};
pub use setting_text::{NamedSetting, settings};
pub use update::{
    FirmwareImage, ImageFileError, UpdateError, UpdateEvent, Updated, confirm, hardware_name, restart, roll_back,
    update, version_text,
};
