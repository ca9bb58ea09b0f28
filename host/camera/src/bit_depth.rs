//! Images of 16 bits per channel, as 8 bits.

use image::{DynamicImage, RgbImage};

/// Bits in which cameras measure. Files of 16 bits hold them in their lowest places.
const MEASURED_BITS: [u32; 5] = [8, 10, 12, 14, 16];

/// The image with 8 bits per channel. Of 16 bits the upper 8 are kept of those that the image uses: of 12 bits in a file of 16,
/// the four lowest are lost, and not all but four.
pub fn in_eight_bits(image: DynamicImage) -> RgbImage {
    let is_deep = matches!(
        image,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    if !is_deep {
        return image.into_rgb8();
    }
    let deep = image.into_rgb16();
    let most = deep.as_raw().iter().copied().max().unwrap_or_default();
    let bits = MEASURED_BITS.into_iter().find(|&bits| u32::from(most) < 1 << bits).unwrap_or(16);
    let samples = deep.as_raw().iter().map(|sample| (sample >> (bits - 8)) as u8).collect();
    RgbImage::from_raw(deep.width(), deep.height(), samples).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, Luma};

    use super::*;

    /// The red samples of a row of 16-bit pixels.
    fn reduced(row: &[u16]) -> Vec<u8> {
        let deep = ImageBuffer::<Luma<u16>, _>::from_raw(row.len() as u32, 1, row.to_vec());
        in_eight_bits(DynamicImage::ImageLuma16(deep.unwrap_or_default())).pixels().map(|pixel| pixel.0[0]).collect()
    }

    #[test]
    fn the_bits_that_are_used_are_kept() {
        assert_eq!(reduced(&[0, 256, 32768, 65535]), [0, 1, 128, 255]);
        assert_eq!(reduced(&[0, 16, 2048, 4095]), [0, 1, 128, 255]);
        assert_eq!(reduced(&[0, 4, 512, 1023]), [0, 1, 128, 255]);
        assert_eq!(reduced(&[0, 1, 128, 255]), [0, 1, 128, 255]);
        assert_eq!(reduced(&[0, 0]), [0, 0]);
    }
}
