//! Events of a camera that is watched while it runs.

use std::fmt;

use image::RgbImage;
use vergence_rig::{ExposureTiming, HostInstant};

use crate::CameraError;

/// Makes an image: decodes or renders it.
pub type Develop = Box<dyn FnOnce() -> Result<RgbImage, CameraError> + Send>;

/// An image that is made when it is wanted: decoding or rendering an image that is skipped would be wasted.
pub struct PendingImage {
    /// The camera's own number of the image, lost ones counted.
    pub seq: u32,
    /// Middle of the exposure of the middle row.
    pub middle: HostInstant,
    /// Number of bytes that the camera sent for it; `None` where it came over no cable.
    pub bytes: Option<u32>,
    /// Makes the image.
    pub develop: Develop,
}

impl fmt::Debug for PendingImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PendingImage").field("seq", &self.seq).field("middle", &self.middle).finish_non_exhaustive()
    }
}

/// An event in the life of a camera.
#[derive(Debug)]
pub enum CameraEvent {
    /// The camera is attached, for the first time or again, and exposes like this.
    Attached(ExposureTiming),
    /// The camera took an image.
    Image(PendingImage),
    /// The camera is gone; the text says why.
    Lost(String),
}
