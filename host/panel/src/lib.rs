//! The page on which people see and drive a rig, in any browser: modes, axes and a stop, both images with their matches, the cloud, zones and
//! predicted errors, plots, and the log.
//!
//! [`Panel`] takes what the rig and the live loop tell and keeps the latest of every stream ([`Streams`]); a server on a thread of its own
//! sends it to every page ([`Panel::serve`]). A page that is slow skips what it has no time for, and nothing that the server does delays the
//! rig. Orders go the other way: one page drives, the others watch ([`Operators`]), and [`Session::run`] carries the orders out as the
//! verbs of the command line do. When the page that drives is closed or silent, the rig stops.
//!
//! State, messages and the rules of who drives are pure; sockets are in `server` and `connection`.

mod assets;
mod board_log;
mod capture;
mod cloud;
mod connection;
mod driver;
mod error;
mod guard;
mod hub;
mod log;
mod message;
mod operators;
mod panel;
mod pictures;
mod remote;
mod rigs;
mod screen;
mod server;
mod session;
mod status;
mod streams;
mod view;
mod without_link;

pub use capture::{CaptureCamera, CapturePanel, CapturePose, CaptureProgress};
pub use cloud::cloud_message;
pub use driver::Driver;
pub use error::PanelError;
pub use guard::{Access, Refused};
pub use hub::Setting;
pub use log::{Level, Log};
pub use message::{GoalOrder, Order, PageMessage, packed};
pub use operators::{ClientId, Control, LATEST_BEAT, Operators};
pub use panel::Panel;
pub use remote::{Remote, Remotes};
pub use rigs::{RigsOnPage, serve_rigs};
pub use screen::Screen;
pub use server::{Serving, listen};
pub use session::{Session, Shown};
pub use streams::{Outgoing, Seen, Stream, Streams};
pub use view::{SPHERE_COLUMNS, SPHERE_ROWS, sphere_message, view_json};
