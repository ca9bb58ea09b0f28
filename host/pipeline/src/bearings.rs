//! What one camera alone can measure: directions, without range.

use image::RgbImage;
use image::imageops::grayscale;
use vergence_matching::image_corners;
use vergence_vision::{Angle, Camera, KannalaBrandt, Pixel, UnitRay};

use crate::limits::CORNER_SIGMA;
use crate::pair::colour_at;

/// Most bearings of one image.
const MOST_BEARINGS: usize = 2000;

/// The direction of one corner of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// The direction in the camera's own frame.
    pub direction: UnitRay<Camera>,
    /// Standard deviation of the direction: the larger of radial and tangential.
    pub sigma: Angle,
    /// The position in the image.
    pub pixel: Pixel,
    /// sRGB.
    pub colour: [u8; 3],
}

/// The corners of one image as directions: what is left where the other camera is dead.
#[must_use]
pub fn bearings(image: &RgbImage, lens: &KannalaBrandt) -> Vec<Bearing> {
    let bearing = |pixel: Pixel| {
        let direction = lens.unproject::<Camera>(pixel).ok()?;
        let by_pixel = lens.ray_by_pixel(&direction);
        let coarser = by_pixel.column(0).norm().max(by_pixel.column(1).norm());
        let sigma = Angle::from_rad(CORNER_SIGMA * coarser);
        Some(Bearing { direction, sigma, pixel, colour: colour_at(image, pixel) })
    };
    image_corners(&grayscale(image), lens, MOST_BEARINGS).into_iter().filter_map(bearing).collect()
}
