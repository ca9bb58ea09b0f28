//! A range for every pixel as images: to compute with, and to look at.

use image::{ImageBuffer, ImageError, ImageFormat, Luma, Rgb, RgbImage};
use vergence_matching::{DenseDepth, DenseSample};

use super::panels::{ColourScale, Panels, light_grey};

/// 16 bits of grey for each pixel.
pub type Grey16 = ImageBuffer<Luma<u16>, Vec<u16>>;

/// The value of the range image for a pixel that is farther than can be measured, and for one at 65 534 mm or more.
const FAR: u16 = u16::MAX;
/// Steps of the sigma image per millimetre.
const SIGMA_STEPS: f64 = 10.0;

/// The distance from the left optical centre in whole millimetres; 0 where there is none, 65535 where it is farther than
/// can be measured.
#[must_use]
pub fn range_image(depth: &DenseDepth) -> Grey16 {
    image_of(depth, |sample| match sample {
        DenseSample::Measured(point) => point.range().mm().round().clamp(1.0, f64::from(FAR - 1)) as u16,
        DenseSample::Far => FAR,
        DenseSample::Gap(_) => 0,
    })
}

/// The standard deviation of the distance in tenths of a millimetre; 0 where there is no distance, 65535 for 6.5 m or more.
#[must_use]
pub fn sigma_image(depth: &DenseDepth) -> Grey16 {
    image_of(depth, |sample| match sample {
        DenseSample::Measured(point) => {
            (point.sigma().mm() * SIGMA_STEPS).round().clamp(1.0, f64::from(u16::MAX)) as u16
        }
        DenseSample::Far | DenseSample::Gap(_) => 0,
    })
}

/// The similarity of both windows, from 1 (not at all) to 255 (the same); 0 where there is no distance.
#[must_use]
pub fn confidence_image(depth: &DenseDepth) -> ImageBuffer<Luma<u8>, Vec<u8>> {
    image_of(depth, |sample| match sample {
        DenseSample::Measured(point) => (point.confidence() * 255.0).round().clamp(1.0, 255.0) as u8,
        DenseSample::Far | DenseSample::Gap(_) => 0,
    })
}

fn image_of<T: image::Primitive>(depth: &DenseDepth, value: impl Fn(&DenseSample) -> T) -> ImageBuffer<Luma<T>, Vec<T>>
where
    Luma<T>: image::Pixel<Subpixel = T>,
{
    let size = depth.size();
    let width = size.width as usize;
    ImageBuffer::from_fn(size.width, size.height, |x, y| {
        Luma([value(&depth.samples()[y as usize * width + x as usize])])
    })
}

/// The left image, and beside it the range of every pixel as colour: white where it is farther than can be measured, the grey
/// image where there is none.
///
/// # Errors
/// Where an image cannot be encoded.
pub fn dense_svg(left: &RgbImage, depth: &DenseDepth) -> Result<String, ImageError> {
    let ranges = depth.samples().iter().filter_map(|sample| match sample {
        DenseSample::Measured(point) => Some(point.range().mm()),
        DenseSample::Far | DenseSample::Gap(_) => None,
    });
    let scale = ColourScale::of_ranges(ranges);
    let width = left.width().max(1);
    let mut coloured = light_grey(left);
    for (index, sample) in (0..width * left.height()).zip(depth.samples()) {
        let colour = match sample {
            DenseSample::Measured(point) => scale.colour(point.range().mm()),
            DenseSample::Far => [255; 3],
            DenseSample::Gap(_) => continue,
        };
        coloured.put_pixel(index % width, index / width, Rgb(colour));
    }
    let mut panels = Panels::new(left.dimensions(), &["left image", "range"]);
    panels.image(0, left, ImageFormat::Jpeg)?;
    panels.image(1, &coloured, ImageFormat::Png)?;
    Ok(panels.finish(&scale, "range of every pixel; grey: none; white: farther than can be measured"))
}
