//! Images as PNG files: without loss, and quickly rather than small.

use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError, RgbImage};

/// An image as a file, in one channel where all are the same.
pub struct Png {
    /// Whether there is one channel.
    pub is_grey: bool,
    /// The file.
    pub bytes: Vec<u8>,
}

impl Png {
    /// `image` as a file.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn of(image: &RgbImage) -> Result<Self, ImageError> {
        let mut file = Cursor::new(Vec::new());
        let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Up);
        let (width, height) = image.dimensions();
        let is_grey = image.pixels().all(|pixel| pixel.0[0] == pixel.0[1] && pixel.0[1] == pixel.0[2]);
        if is_grey {
            let grey: Vec<u8> = image.pixels().map(|pixel| pixel.0[0]).collect();
            encoder.write_image(&grey, width, height, ExtendedColorType::L8)?;
        } else {
            encoder.write_image(image.as_raw(), width, height, ExtendedColorType::Rgb8)?;
        }
        Ok(Self { is_grey, bytes: file.into_inner() })
    }
}
