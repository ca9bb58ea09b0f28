//! Recordings of the rig, and their replay.
//!
//! A recording is a ROS 2 bag: an MCAP file with images, lenses, joints, transforms, clouds and warnings as standard messages for other programs, and with
//! the rig file attached. Beside them the topic `/vergence/events` keeps all that the live loop heard, in its order: [`Replay`] makes the same clouds of it.

mod bag;
mod cdr;
mod error;
mod event;
mod keep;
pub mod messages;
mod metadata;
mod play;
mod png;
mod reader;
mod recorder;
mod recording;
mod replay;
mod tap;

pub use bag::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS, Topic};
pub use cdr::Cdr;
pub use error::RecordingError;
pub use event::{Beginning, Event, Eye, Stamp, Timing};
pub use play::{Pacing, play};
pub use reader::{Heard, Reader};
pub use recorder::{Recorded, Recorder, Writing};
pub use recording::{Recordable, Recording};
pub use replay::Replay;
pub use tap::{recorded_events, recorded_marks};
