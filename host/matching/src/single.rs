//! What one image shows by itself: corners, worth a bearing where the other camera is dead.

use image::GrayImage;
use vergence_vision::{Camera, KannalaBrandt, Pixel};

use crate::corners::{self, Keypoint};
use crate::plane::{Plane, Pyramid};

/// Finest first; coarser corners of one image are of no use to anyone.
const LEVELS: usize = 1;
/// Corners nearer than this to the edge of the lens's field may be the edge itself, in pixels.
const MARGIN: f64 = 8.0;

/// At most `most` corners of `image`, spread over what `camera` sees, by rows. Empty where the image is not of the camera's
/// size.
#[must_use]
pub fn image_corners(image: &GrayImage, camera: &KannalaBrandt, most: usize) -> Vec<Pixel> {
    let (width, height) = image.dimensions();
    if (width, height) != (camera.size().width, camera.size().height) {
        return Vec::new();
    }
    let plane = Plane::new(width as usize, height as usize, image.iter().map(|&level| f32::from(level)).collect());
    let inside = |keypoint: &Keypoint| {
        [-MARGIN, 0.0, MARGIN].iter().all(|dv| {
            [-MARGIN, 0.0, MARGIN]
                .iter()
                .all(|du| camera.unproject::<Camera>(Pixel { u: keypoint.at.x + du, v: keypoint.at.y + dv }).is_ok())
        })
    };
    corners::detect(&Pyramid::new(&plane, LEVELS), most, inside)
        .into_iter()
        .map(|keypoint| Pixel { u: keypoint.at.x, v: keypoint.at.y })
        .collect()
}
