//! Cameras: one trait for attached and simulated ones, image files and folders.

mod exposure;
mod files;
mod jpeg;
mod pixel_format;
mod simulated;
mod simulated_board;
mod together;
mod v4l;

use image::RgbImage;
use vergence_rig::HostInstant;

pub use exposure::{FrameTiming, StampedAt};
pub use files::{FileCamera, read_image};
pub use simulated::{SimulatedCamera, Stage};
pub use simulated_board::{BoardStage, SimulatedBoardCamera};
pub use together::{CameraSet, as_event, as_stamped, side_by_side};
pub use v4l::{Settings as V4lSettings, V4lCamera};

use crate::failure::Failure;

/// One image and when it was exposed.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The picture.
    pub image: RgbImage,
    /// What to call it in messages and file names.
    pub name: String,
    /// The camera's own number of it, lost ones counted; `None` where it does not count.
    pub seq: Option<u32>,
    /// Middle of the exposure of the middle row on the host's clock, and how far that may be off; `None` where nobody knows,
    /// as for a file.
    pub exposed_at: Option<HostInstant>,
}

/// A source of frames.
pub trait Camera: Send {
    /// The next frame; `None` after the last one.
    ///
    /// # Errors
    /// Says which camera or file, and why.
    fn grab(&mut self) -> Result<Option<Frame>, Failure>;

    /// How it takes its frames; `None` where it has no time, as a folder of files.
    fn timing(&self) -> Option<FrameTiming> {
        None
    }

    /// How many frames were lost before they came here; 0 where nothing numbers them.
    fn missed(&self) -> u64 {
        0
    }
}
