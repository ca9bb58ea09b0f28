//! What one camera alone can measure: directions, without range.

use image::RgbImage;
use image::imageops::grayscale;
use nalgebra::SMatrix;
use vergence_matching::image_corners;
use vergence_vision::{Angle, Camera, KannalaBrandt, LENS_PARAMETERS, Pixel, UnitRay};

use crate::limits::CORNER_SIGMA;
use crate::pair::colour_at;

/// Most bearings of one image.
const MOST_BEARINGS: usize = 2000;

/// The direction of one corner of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// The direction in the camera's own frame.
    pub direction: UnitRay<Camera>,
    /// Standard deviation of the direction along which it is largest, by the corner and by the lens.
    pub sigma: Angle,
    /// The position in the image.
    pub pixel: Pixel,
    /// sRGB.
    pub colour: [u8; 3],
    /// Whether the lens was not measured there, and is extrapolated.
    pub extrapolated: bool,
}

/// The corners of one image as directions: what is left where the other camera is dead. `errors` is the covariance of the lens, in the order of
/// [`LENS_PARAMETERS`]; zero of a lens that counts as exact.
#[must_use]
pub fn bearings(
    image: &RgbImage,
    lens: &KannalaBrandt,
    errors: &SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>,
) -> Vec<Bearing> {
    let bearing = |pixel: Pixel| {
        let direction = lens.unproject::<Camera>(pixel).ok()?;
        let by_pixel = lens.ray_by_pixel(&direction);
        let by_lens = by_pixel * lens.pixel_by_lens(&direction);
        let spread =
            CORNER_SIGMA * CORNER_SIGMA * by_pixel * by_pixel.transpose() + by_lens * errors * by_lens.transpose();
        let sigma = Angle::from_rad(spread.symmetric_eigenvalues().max().max(0.0).sqrt());
        let (colour, extrapolated) = (colour_at(image, pixel), !lens.is_measured(&direction));
        Some(Bearing { direction, sigma, pixel, colour, extrapolated })
    };
    image_corners(&grayscale(image), lens, MOST_BEARINGS).into_iter().filter_map(bearing).collect()
}
