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

    /// Adds `factor` times the grey levels at `position` and at all places up to `reach` whole pixels from it along both axes to `sums`, row by row; not a
    /// number outside the image.
    pub fn add_around(&self, position: Vector2<f64>, factor: f64, reach: i32, sums: &mut [f64]) {
        let (x, y) = (whole(position.x), whole(position.y));
        let (right, below) = (position.x - x as f64, position.y - y as f64);
        let [across, down] = [[1.0 - right, right], [1.0 - below, below]];
        let weights = [across.map(|part| part * down[0] * factor), across.map(|part| part * down[1] * factor)];
        let (x, side) = (x - i64::from(reach), (2 * reach + 1).unsigned_abs() as usize);
        for (sums, y) in sums.chunks_exact_mut(side).zip(y - i64::from(reach)..) {
            let Some(rows) = self.row(x, y, side + 1).zip(self.row(x, y + 1, side + 1)) else {
                for (sum, x) in sums.iter_mut().zip(x..) {
                    let four = [self.at(x, y), self.at(x + 1, y), self.at(x, y + 1), self.at(x + 1, y + 1)];
                    let weighted = four.into_iter().zip(weights.concat()).map(|(level, weight)| Some(level? * weight));
                    *sum += weighted.sum::<Option<f64>>().unwrap_or(f64::NAN);
                }
                continue;
            };
            add_bilinear(sums, rows, &weights);
        }
    }

    /// Pixels of a row from column `x` on; `None` where some are outside the image.
    fn row(&self, x: i64, y: i64, count: usize) -> Option<&'a [u8]> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x + count > self.width { None } else { self.levels.get(y * self.width + x..)?.get(..count) }
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

/// Adds the weighted sums of each two neighbours in two rows.
fn add_bilinear(sums: &mut [f64], (above, below): (&[u8], &[u8]), weights: &[[f64; 2]; 2]) {
    let pairs = above.iter().zip(&above[1..]).zip(below.iter().zip(&below[1..]));
    for (sum, ((a, b), (c, d))) in sums.iter_mut().zip(pairs) {
        let upper = f64::from(*a) * weights[0][0] + f64::from(*b) * weights[0][1];
        *sum += upper + (f64::from(*c) * weights[1][0] + f64::from(*d) * weights[1][1]);
    }
}

/// The largest whole number that is not above `x`. Much quicker than [`f64::floor`] where processors of all ages are served.
fn whole(x: f64) -> i64 {
    let towards_zero = x as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > x))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails loudly")]

    use image::Luma;

    use super::*;

    #[test]
    fn sums_around_a_place_are_those_of_single_places() {
        let image = GrayImage::from_fn(23, 17, |x, y| Luma([(x * 37 + y * 101 + x * y * 13) as u8]));
        let intensity = Intensity::new(&image);
        for position in [Vector2::new(10.3, 8.6), Vector2::new(2.25, 14.5), Vector2::new(20.7, 0.0)] {
            let (reach, mut sums) = (4, vec![1.0; 81]);
            intensity.add_around(position, -0.5, reach, &mut sums);
            let offsets = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| [x, y]));
            for (sum, [x, y]) in sums.into_iter().zip(offsets) {
                let single = intensity.between(position + Vector2::new(f64::from(x), f64::from(y)));
                match single {
                    Some(level) => assert!((sum - (1.0 - 0.5 * level)).abs() < 1e-9, "{position} {x} {y}"),
                    None => assert!(sum.is_nan(), "{position} {x} {y}"),
                }
            }
        }
    }
}
