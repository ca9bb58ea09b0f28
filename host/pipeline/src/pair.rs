//! The images of both cameras.

use image::{GrayImage, RgbImage};
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
        let (left, right) = rayon::join(|| grey(self.left), || grey(self.right));
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

/// The image in grey, as `image::imageops::grayscale` makes it, in a fraction of its time.
fn grey(image: &RgbImage) -> GrayImage {
    /// Ten thousandths of red, green and blue (Rec. 709).
    const WEIGHTS: [u32; 3] = [2126, 7152, 722];
    let (pixels, _) = image.as_raw().as_chunks::<3>();
    let level = |pixel: &[u8; 3]| {
        let [red, green, blue] = pixel.map(u32::from);
        ((WEIGHTS[0] * red + WEIGHTS[1] * green + WEIGHTS[2] * blue) / 10_000) as u8
    };
    let levels = pixels.iter().map(level).collect();
    GrayImage::from_raw(image.width(), image.height(), levels).unwrap_or_else(|| image::imageops::grayscale(image))
}

/// The sRGB colour of the pixel nearest to a position, black outside the image.
#[must_use]
pub fn colour_at(image: &RgbImage, pixel: Pixel) -> [u8; 3] {
    // Positions lie on the sensor, so rounding stays inside; the cast saturates if one ever does not.
    let (x, y) = (pixel.u.round().max(0.0) as u32, pixel.v.round().max(0.0) as u32);
    image.get_pixel_checked(x, y).map_or([0; 3], |colour| colour.0)
}

#[cfg(test)]
mod tests {
    use image::{Rgb, imageops};

    use super::*;

    #[test]
    fn grey_is_that_of_the_image_library() {
        let image = RgbImage::from_fn(256, 97, |x, y| Rgb([x as u8, (7 * x + 5 * y) as u8, (13 * y) as u8]));
        assert_eq!(grey(&image), imageops::grayscale(&image));
    }
}
