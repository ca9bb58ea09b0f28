//! Cameras of the Linux kernel and image files, behind one trait.
//!
//! [`V4lCamera`] is an attached camera, [`FileCamera`] a folder of images, [`Played`] folders and videos at the pace at which they were taken. A [`CameraSet`] takes images with one or two of
//! them, paired by exposure time where the cameras stamp their images. [`attach`] watches a camera from a thread of its own
//! and reports what happens as [`CameraEvent`]s. Simulated cameras implement [`Camera`] too, in a crate of their own.

mod attached;
mod bit_depth;
mod error;
mod event;
mod files;
mod jpeg;
mod listing;
mod mask;
mod pairing;
mod pixel_format;
mod played;
mod quality;
mod set;
mod usb;
mod v4l;
mod v4l_controls;
mod y4m;

use image::RgbImage;
use vergence_rig::{ExposureTiming, HostInstant};
use vergence_vision::{ImageSize, Side};

pub use attached::attach;
pub use error::CameraError;
pub use event::{CameraEvent, Develop, PendingImage};
pub use files::{FileCamera, image_files, read_image};
pub use listing::{ListedCamera, ListedFormat, describe_camera, video_devices};
pub use mask::{camera_mask, read_mask, with_whole_name};
pub use pairing::{PairedFiles, paired};
pub use played::{PLAYED_HZ, Played, PlayedCamera, SharedTime, is_played, play};
pub use quality::{Field, ImageQuality};
pub use set::CameraSet;
pub use usb::UsbLink;
pub use v4l::{HostTime, V4lCamera, V4lSettings};

/// One image and the time of its exposure.
#[derive(Clone, Debug)]
pub struct CameraImage {
    /// The image, 8 bits per channel.
    pub image: RgbImage,
    /// Name for messages and file names.
    pub name: String,
    /// The camera's own number of the image, lost ones counted; `None` where it does not count.
    pub seq: Option<u32>,
    /// Middle of the exposure of the middle row, on the host's clock, with its largest error; `None` where it is unknown, as
    /// for a file.
    pub exposed_at: Option<HostInstant>,
    /// Number of bytes that the camera sent for it; `None` where it came over no cable.
    pub bytes: Option<u32>,
}

impl CameraImage {
    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> ImageSize {
        ImageSize { width: self.image.width(), height: self.image.height() }
    }

    /// Checks that the image is as large as those of the camera at `side` of the rig, `wanted`.
    ///
    /// # Errors
    /// [`CameraError::Size`]
    pub fn check_size(&self, wanted: ImageSize, side: Side) -> Result<(), CameraError> {
        let size = self.size();
        if size == wanted {
            return Ok(());
        }
        Err(CameraError::Size { side, name: self.name.clone(), size, wanted })
    }
}

/// A source of images.
pub trait Camera: Send {
    /// Takes the next image; `None` after the last one.
    ///
    /// # Errors
    /// Returns an error that names the camera or file and the cause.
    fn grab(&mut self) -> Result<Option<CameraImage>, CameraError>;

    /// Timing of the exposures; `None` where images have no time, as those of a folder.
    fn timing(&self) -> Option<ExposureTiming> {
        None
    }

    /// Number of images lost between the camera and [`Self::grab`]; 0 where images are not numbered.
    fn missed(&self) -> u64 {
        0
    }
}
