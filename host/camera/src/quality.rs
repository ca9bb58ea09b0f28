//! How well an image is exposed, and how sharp it is, inside the field of its lens.

use image::RgbImage;
use vergence_vision::{BodyMask, Camera, ImageSize, KannalaBrandt, Pixel};

/// From this level on a channel counts as saturated, of 255.
const SATURATED: u8 = 250;
/// Up to this level a pixel counts as black, of 255.
const BLACK: f64 = 5.0;

/// The pixels of a camera that show something: inside the lens's field and not masked. A fisheye's corners are always black.
#[derive(Clone, Debug)]
pub struct Field {
    size: ImageSize,
    inside: Vec<bool>,
}

impl Field {
    /// The field of `lens` without what `mask` hides.
    #[must_use]
    pub fn of(lens: &KannalaBrandt, mask: Option<&BodyMask>) -> Self {
        let size = lens.size();
        let pixels = (0..size.height).flat_map(|v| (0..size.width).map(move |u| (u, v)));
        let shows = |(u, v): (u32, u32)| {
            let pixel = Pixel { u: f64::from(u), v: f64::from(v) };
            lens.unproject::<Camera>(pixel).is_ok() && !mask.is_some_and(|mask| mask.hides(pixel))
        };
        Self { size, inside: pixels.map(shows).collect() }
    }

    /// Whether the pixel shows something.
    fn has(&self, u: u32, v: u32) -> bool {
        self.inside.get(v as usize * self.size.width as usize + u as usize).copied().unwrap_or_default()
    }
}

/// Figures of one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageQuality {
    /// Mean grey level inside the field, 0 to 255.
    pub mean: f64,
    /// Part of the field that is saturated: 250 or more in a channel.
    pub saturated: f64,
    /// Part of the field that is black: a grey level of 5 or less.
    pub black: f64,
    /// Variance of the Laplacian of the grey levels (J. L. Pech-Pacheco et al., ICPR 2000), over the kernel 0 1 0, 1 -4 1, 0 1 0: what OpenCV gives as
    /// `cv2.Laplacian(grey, cv2.CV_64F).var()`. It grows with sharpness, contrast and noise, so that only images of the same scene compare.
    pub sharpness: f64,
}

impl ImageQuality {
    /// The figures of `image`; `None` where it is not of the field's size, or nothing of it lies inside.
    #[must_use]
    pub fn of(image: &RgbImage, field: &Field) -> Option<Self> {
        let (width, height) = image.dimensions();
        if (ImageSize { width, height }) != field.size {
            return None;
        }
        let grey: Vec<f64> = image.pixels().map(|pixel| grey(pixel.0)).collect();
        let level = |u: u32, v: u32| grey.get(v as usize * width as usize + u as usize).copied().unwrap_or_default();
        let (mut count, mut sum, mut saturated, mut black) = (0_u32, 0.0, 0_u32, 0_u32);
        let mut edges = Moments::default();
        for (u, v, pixel) in image.enumerate_pixels().filter(|(u, v, _)| field.has(*u, *v)) {
            count += 1;
            sum += level(u, v);
            saturated += u32::from(pixel.0.iter().any(|&channel| channel >= SATURATED));
            black += u32::from(level(u, v) <= BLACK);
            let around = [(u.wrapping_sub(1), v), (u + 1, v), (u, v.wrapping_sub(1)), (u, v + 1)];
            if around.iter().all(|&(u, v)| u < width && v < height && field.has(u, v)) {
                edges.take(around.iter().map(|&(u, v)| level(u, v)).sum::<f64>() - 4.0 * level(u, v));
            }
        }
        let share = |part: u32| f64::from(part) / f64::from(count);
        (count > 0).then(|| Self {
            mean: sum / f64::from(count),
            saturated: share(saturated),
            black: share(black),
            sharpness: edges.variance(),
        })
    }
}

/// The grey level of a pixel by ITU-R BT.601, as OpenCV rounds it.
fn grey([r, g, b]: [u8; 3]) -> f64 {
    f64::from((u32::from(r) * 4899 + u32::from(g) * 9617 + u32::from(b) * 1868 + 8192) >> 14)
}

#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u32,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn take(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.squares += value * value;
    }

    fn variance(self) -> f64 {
        let count = f64::from(self.count.max(1));
        (self.squares / count - (self.sum / count).powi(2)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    fn whole(width: u32, height: u32) -> Field {
        let size = ImageSize { width, height };
        Field { size, inside: vec![true; (width * height) as usize] }
    }

    /// Stripes of one pixel: the Laplacian is 4 times their height apart, of either sign. OpenCV gives 160000 for columns of 0 and 200 in its interior.
    #[test]
    fn sharpness_is_the_variance_of_the_laplacian() {
        let stripes = RgbImage::from_fn(10, 10, |x, _| Rgb([200 * (x % 2) as u8; 3]));
        let quality = ImageQuality::of(&stripes, &whole(10, 10)).expect("figures");
        assert!((quality.sharpness - 160_000.0).abs() < 1e-6, "{quality:?}");
        assert!((quality.mean - 100.0).abs() < 1e-9 && (quality.black - 0.5).abs() < 1e-9 && quality.saturated == 0.0);
        let flat = RgbImage::from_pixel(10, 10, Rgb([255, 10, 10]));
        let quality = ImageQuality::of(&flat, &whole(10, 10)).expect("figures");
        assert_eq!((quality.sharpness, quality.saturated, quality.black), (0.0, 1.0, 0.0));
    }

    #[test]
    fn what_lies_outside_of_the_field_counts_for_nothing() {
        let mut image = RgbImage::from_pixel(6, 4, Rgb([100; 3]));
        image.put_pixel(0, 0, Rgb([0; 3]));
        image.put_pixel(5, 0, Rgb([255; 3]));
        let mut field = whole(6, 4);
        field.inside[0] = false;
        field.inside[5] = false;
        let quality = ImageQuality::of(&image, &field).expect("figures");
        assert_eq!((quality.mean, quality.saturated, quality.black, quality.sharpness), (100.0, 0.0, 0.0, 0.0));
        assert_eq!(ImageQuality::of(&image, &whole(4, 6)), None);
    }
}
