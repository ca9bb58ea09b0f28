//! Decodes the pixel formats of cameras to RGB.

use image::{ImageFormat, RgbImage};

use crate::jpeg;

/// A pixel format that can be decoded. The order is that of preference: the least processed comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// 8-bit grey.
    Grey,
    /// YUV 4:2:2, packed Y0 U Y1 V.
    Yuyv,
    /// One JPEG per image.
    Mjpeg,
}

impl PixelFormat {
    /// All formats, in order of preference.
    pub const ALL: [Self; 3] = [Self::Grey, Self::Yuyv, Self::Mjpeg];

    /// The kernel's four-character code of the format.
    #[must_use]
    pub const fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Yuyv => *b"YUYV",
            Self::Mjpeg => *b"MJPG",
        }
    }

    /// Decodes the image in `bytes`, whose rows are `stride` bytes apart; `None` where bytes are missing or damaged.
    #[must_use]
    pub fn decode(self, bytes: &[u8], (width, height): (u32, u32), stride: u32) -> Option<RgbImage> {
        let rows = || bytes.chunks(stride.max(1) as usize).take(height as usize);
        match self {
            Self::Grey => {
                let rgb = rows().flat_map(|row| row.iter().take(width as usize)).flat_map(|&grey| [grey; 3]);
                RgbImage::from_raw(width, height, rgb.collect())
            }
            Self::Yuyv => {
                let pairs = width.div_ceil(2) as usize;
                let rgb: Vec<u8> = rows()
                    .flat_map(|row| {
                        let pixels = row.chunks_exact(4).take(pairs).flat_map(pair_to_rgb);
                        pixels.take(width as usize).flatten()
                    })
                    .collect();
                RgbImage::from_raw(width, height, rgb)
            }
            Self::Mjpeg => {
                // The decoder would fill lost bytes with grey.
                let bytes = Some(bytes).filter(|bytes| jpeg::is_whole(bytes))?;
                let image = image::load_from_memory_with_format(bytes, ImageFormat::Jpeg).ok()?.into_rgb8();
                (image.dimensions() == (width, height)).then_some(image)
            }
        }
    }
}

/// Converts two pixels of full-range ITU-R BT.601, as webcams send them.
fn pair_to_rgb(yuyv: &[u8]) -> [[u8; 3]; 2] {
    let &[y0, u, y1, v] = yuyv else { return [[0; 3]; 2] };
    let (u, v) = (f32::from(u) - 128.0, f32::from(v) - 128.0);
    [y0, y1].map(|y| {
        let y = f32::from(y);
        [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u].map(|c| c.round().clamp(0.0, 255.0) as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_rows_may_be_padded() {
        let image = PixelFormat::Grey.decode(&[1, 2, 99, 3, 4, 99], (2, 2), 3).expect("enough bytes");
        assert_eq!(image.as_raw(), &[1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4]);
        assert_eq!(PixelFormat::Grey.decode(&[1, 2, 99, 3], (2, 2), 3), None);
    }

    /// Numbers of ITU-R BT.601: pure red is Y 76, U 85, V 255 in full range.
    #[test]
    fn yuyv_red_and_grey() {
        let image = PixelFormat::Yuyv.decode(&[76, 85, 76, 255], (2, 1), 4).expect("enough bytes");
        let [r, g, b] = image.get_pixel(0, 0).0;
        assert!(r > 250 && g < 5 && b < 5, "{r} {g} {b}");
        let image = PixelFormat::Yuyv.decode(&[10, 128, 200, 128], (2, 1), 4).expect("enough bytes");
        assert_eq!((image.get_pixel(0, 0).0, image.get_pixel(1, 0).0), ([10; 3], [200; 3]));
    }

    #[test]
    fn a_broken_jpeg_is_no_picture() {
        assert_eq!(PixelFormat::Mjpeg.decode(&[0xff, 0xd8, 0xff, 0x00], (2, 1), 0), None);
    }
}
