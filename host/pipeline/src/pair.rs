//! The images of both cameras.

use image::RgbImage;
use image::imageops::grayscale;
use vergence_matching::ImagePair;
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Angle, Pixel};

use crate::search::Search;

/// The images that both cameras took at one instant.
#[derive(Clone, Copy, Debug)]
pub struct PairImages<'a> {
    /// The image of the left camera.
    pub left: &'a RgbImage,
    /// The image of the right camera.
    pub right: &'a RgbImage,
}

impl PairImages<'_> {
    /// Calls `work` with both images in grey, what is known of their cameras, and where points are sought; `pose_sigma` is the
    /// standard deviation of the relative rotation in `pose`.
    pub(crate) fn with_grey<T>(
        self,
        (rig, search): (&Rig, &Search),
        pose: &RigPose,
        pose_sigma: Angle,
        work: impl FnOnce(&ImagePair<'_>) -> T,
    ) -> T {
        let (left, right) = (grayscale(self.left), grayscale(self.right));
        work(&ImagePair {
            left: &left,
            right: &right,
            left_camera: &rig.left_camera,
            right_camera: &rig.right_camera,
            left_from_right: pose.left_from_right,
            pose_sigma,
            nearest: search.nearest_at(pose),
            masks: search.masks.each_ref().map(Option::as_ref),
        })
    }
}

/// The sRGB colour of the pixel nearest to a position, black outside the image.
#[must_use]
pub fn colour_at(image: &RgbImage, pixel: Pixel) -> [u8; 3] {
    // Positions lie on the sensor, so rounding stays inside; the cast saturates if one ever does not.
    let (x, y) = (pixel.u.round().max(0.0) as u32, pixel.v.round().max(0.0) as u32);
    image.get_pixel_checked(x, y).map_or([0; 3], |colour| colour.0)
}
