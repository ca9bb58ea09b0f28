//! Cameras: one trait for simulated ones, image files and folders.

mod exposure;
mod files;
mod jpeg;
mod pixel_format;
mod simulated;
mod simulated_board;
mod v4l;

use image::RgbImage;
use vergence_protocol::Microseconds;

pub use files::{FileCamera, read_image};
pub use simulated::{Eye, SimulatedCamera, Stage};
pub use simulated_board::{BoardStage, SimulatedBoardCamera};
pub use v4l::{Settings as V4lSettings, V4lCamera};

use crate::failure::Failure;

/// One image and when it was exposed.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The picture.
    pub image: RgbImage,
    /// What to call it in messages and file names.
    pub name: String,
    /// Middle of the exposure on the host's clock; `None` where nobody knows, as for a file.
    pub exposed_at: Option<Microseconds>,
}

/// A source of frames.
pub trait Camera: Send {
    /// The next frame; `None` after the last one.
    ///
    /// # Errors
    /// Says which camera or file, and why.
    fn grab(&mut self) -> Result<Option<Frame>, Failure>;
}
