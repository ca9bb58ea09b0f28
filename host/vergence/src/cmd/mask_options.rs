//! What is left out of the images of both cameras.

use std::path::PathBuf;

use vergence_calibration_input::PairMasks;
use vergence_camera::{CameraError, read_mask};
use vergence_vision::{BodyMask, ImageSize};

/// What is left out of the images: the robot's own body, a hood, the mount, all outside the image circle.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MaskOptions {
    /// What is left out of the left images, as the robot's body, a hood, or all outside the image circle: a PNG image of the camera's
    /// size, black there, or a TOML file of polygons and circles. Nothing is taken there.
    #[arg(long, value_name = "FILE")]
    left_mask: Option<PathBuf>,
    /// The same of the right images.
    #[arg(long, value_name = "FILE")]
    right_mask: Option<PathBuf>,
}

impl MaskOptions {
    /// Whether a mask is given.
    pub const fn is_given(&self) -> bool {
        self.left_mask.is_some() || self.right_mask.is_some()
    }

    /// The files of both masks.
    pub fn files(&self) -> PairMasks<'_> {
        [self.left_mask.as_deref(), self.right_mask.as_deref()]
    }

    /// Both masks, for cameras of these sizes.
    ///
    /// # Errors
    /// Files that are no masks of these cameras.
    pub fn read(&self, sizes: [ImageSize; 2]) -> Result<[Option<BodyMask>; 2], CameraError> {
        let [left, right] = self.files();
        let read = |path: Option<_>, size| path.map(|path| read_mask(path, size)).transpose();
        Ok([read(left, sizes[0])?, read(right, sizes[1])?])
    }
}
