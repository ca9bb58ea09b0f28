//! Recordings of the rig, and their replay.
//!
//! A recording is a ROS 2 bag: an MCAP file with images, lenses, joints, transforms, clouds and warnings as standard messages for other programs, and with
//! the rig file attached. Beside them the topic `/vergence/events` keeps all that the live loop heard, in its order: [`Replay`] makes the same clouds of it.

mod bag;
mod cdr;
mod error;
mod event;
mod keep;
mod link_gap;
pub mod messages;
mod metadata;
mod play;
mod png;
mod posing;
mod queue;
mod reader;
mod recorder;
mod recording;
mod replay;
mod scribe;
mod tap;
mod views_bag;

pub use bag::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS, Topic};
pub use cdr::Cdr;
pub use error::RecordingError;
pub use event::{Beginning, Event, Eye, Stamp, Timing};
pub use play::{Audience, Jump, Pacing, play};
pub use png::Png;
pub use posing::Posing;
pub use queue::LeftOut;
pub use reader::{Heard, Reader, stamp_ns};
pub use recorder::{Recorded, Recorder, Writing};
pub use recording::{Recordable, Recording};
pub use replay::Replay;
pub use tap::{recorded_events, recorded_marks};
pub use views_bag::{Seen, ViewsBag};
