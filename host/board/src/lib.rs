//! Talks to the controller board over a serial port, TCP or an in-process pipe.
//!
//! [`Client`] holds one protocol session over an open wire, and [`Board`] drives a rig through it: settings, homing, moves.
//! [`ManagementLink`] sends the requests that need no session, and [`update()`] brings new firmware into the board with them.
//! [`Listening`] reads a board for long, also beside a program that drives it. [`check_board`] says what is well and what is
//! not. [`SecretKey`] signs images, and [`ProbeRs`] writes them through a debug probe. [`MovePlan`] shows a move before it is made. [`serve()`] is the other end of a wire: it runs a simulated board at the pace
//! of the clock. All errors are typed and carry a sentence that says what, where, and what to do.

mod board;
mod checks;
mod error;
mod firmware;
mod line_speed;
mod link;
mod link_figures;
mod listening;
mod move_plan;
mod plan_table;
mod serve;
pub mod servos;
mod setting_check;
mod setting_text;
mod settings_file;
mod story;
mod update;
mod who;

pub use board::{
    Board, RecordedEvents, Way, check_range, clock_json, describe_clock, describe_fault, describe_pose, event_in_words,
    mark_json, mark_line, pose_json, pose_line, pose_with_times_json, positions, staying, straight_ways,
};
pub use checks::{BoardChecks, Finding, Verdict, check_board, check_port, forbidden, told};
pub use error::BoardError;
pub use firmware::{
    DEVELOPMENT, FlashContents, KeyError, ProbeError, ProbeRs, PublicKey, SecretKey, fresh_secret, header_json, hex,
    parse_version,
};
pub use line_speed::{SpeedChange, change_line_speed};
pub use link::{
    BoardKnowledge, BoardNews, Client, Continuity, Followed, Follower, HostClock, LastReading, LinkError, LostAxis,
    ManagementLink, OpenError, OpenWire, Patience, Port, PortLock, PulseChain, ReaderMark, RepeatedStop, Told, Wire,
    describe_port, fresh_session, is_candidate, is_held, is_st_link, is_wanted, open, send_stop, serial_ports,
    stop_beside,
};
pub use link_figures::{LinkFigures, LinkLosses};
pub use listening::{Listening, Source, reach_again};
pub use move_plan::{AxisLimits, AxisPlan, Knot, MovePlan, MoveStart};
pub use serve::{BoardGuard, ListenError, Listener, Plug, ServeError, Served, Shared, serve, spawn_in_process};
pub use setting_check::why_refused;
pub use setting_text::{NamedSetting, settings};
pub use settings_file::{SettingsChanged, SettingsFileError};
pub use story::Story;
pub use update::{
    FirmwareImage, ImageFileError, UpdateError, UpdateEvent, Updated, confirm, hardware_name, identity_json,
    identity_words, restart, roll_back, update, version_text,
};
pub use who::{ListedPort, WhoAnswers, list_ports, who_answers};
