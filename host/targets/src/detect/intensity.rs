//! Grey levels at fractional positions.

use image::GrayImage;
use nalgebra::Vector2;

/// Reads an image at whole and fractional positions.
#[derive(Clone, Copy, Debug)]
pub struct Intensity<'a> {
    levels: &'a [u8],
    width: usize,
    height: usize,
}

impl<'a> Intensity<'a> {
    pub fn new(image: &'a GrayImage) -> Self {
        Self { levels: image.as_raw(), width: image.width() as usize, height: image.height() as usize }
    }

    /// The grey level of a pixel, 0 to 255.
    pub fn at(&self, x: i64, y: i64) -> Option<f64> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x >= self.width {
            return None;
        }
        self.levels.get(y * self.width + x).copied().map(f64::from)
    }

    /// The grey level at `position`, bilinear between the four pixels about it.
    pub fn between(&self, position: Vector2<f64>) -> Option<f64> {
        let (x, y) = (whole(position.x), whole(position.y));
        let (right, below) = (position.x - x as f64, position.y - y as f64);
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x + 1 >= self.width || y + 1 >= self.height {
            return None;
        }
        let row = |y: usize| {
            let pixels = self.levels.get(y * self.width + x..)?.first_chunk::<2>()?;
            Some(f64::from(pixels[0]) * (1.0 - right) + f64::from(pixels[1]) * right)
        };
        Some(row(y)? * (1.0 - below) + row(y + 1)? * below)
    }

    /// Central differences, in grey levels per pixel.
    pub fn gradient(&self, x: i64, y: i64) -> Option<Vector2<f64>> {
        let across = self.at(x + 1, y)? - self.at(x - 1, y)?;
        let down = self.at(x, y + 1)? - self.at(x, y - 1)?;
        Some(0.5 * Vector2::new(across, down))
    }

    /// Distance in pixels from `position` to the image's outermost pixel centres; negative outside.
    pub fn margin(&self, position: Vector2<f64>) -> f64 {
        let (right, bottom) = (self.width as f64 - 1.0 - position.x, self.height as f64 - 1.0 - position.y);
        position.x.min(position.y).min(right).min(bottom)
    }
}

/// The largest whole number that is not above `x`. Much quicker than [`f64::floor`] where processors of all ages are served.
fn whole(x: f64) -> i64 {
    let towards_zero = x as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > x))
}
