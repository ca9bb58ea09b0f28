//! The window of a registration: its linear model, its weights, and its samples under a warp.

use std::sync::LazyLock;

use nalgebra::{SMatrix, SVector};

use super::warp::Warp;
use crate::ViewPixel;
use crate::plane::Plane;

/// Half the window's side, in pixels of the level.
pub(super) const HALF: usize = 8;
const SIDE: usize = 2 * HALF + 1;
/// Standard deviation of the Gaussian weights of the window, in pixels.
const WEIGHT_SIGMA: f64 = 4.5;
/// Number of unknowns: four of the warp, gain, bias, and how the gain grows along and across the row.
const UNKNOWNS: usize = 8;
/// Grey level below black at which sRGB, 1.055 L^(1/2.4) - 0.055 of the light L, would begin without its straight part (IEC 61966-2-1):
/// above it levels grow in proportion where the light does.
const BELOW_BLACK: f64 = 255.0 * 0.055;

/// One value for each pixel of the window, by rows.
pub(super) type Patch = [[f64; SIDE]; SIDE];

/// The values of the window with one more pixel on each side, for gradients.
pub(super) type Padded = [[f64; SIDE + 2]; SIDE + 2];

/// Samples `template` around `at`; `None` where the window is not all inside.
#[inline(always)]
pub(super) fn surroundings(template: &Plane, at: ViewPixel) -> Option<Padded> {
    let mut values = [[0.0; SIDE + 2]; SIDE + 2];
    for (j, row) in values.iter_mut().enumerate() {
        let found = template.sample_row::<{ SIDE + 2 }>(at.x + offset(0) - 1.0, 1.0, at.y + offset(j) - 1.0)?;
        row.iter_mut().zip(found).for_each(|(value, found)| *value = f64::from(found));
    }
    Some(values)
}

/// The template's window as the columns of a linear model of the other image's window:
/// I ≈ gain (T + ∇T · step) + bias + slope · (x, y) (T + 14).
///
/// The slope is that of the falloff of a lens: towards the edge of its field it darkens, in the two images of a point in different
/// directions. Without it the window seems displaced towards the brighter side by some thousandths of a pixel, all windows of a region alike
/// (docs/measured/robot.md).
pub(super) struct Window([Patch; UNKNOWNS]);

impl Window {
    #[inline(always)]
    pub(super) fn new(values: &Padded) -> Self {
        let mean = values[HALF + 1][HALF + 1];
        let mut columns = [[[0.0; SIDE]; SIDE]; UNKNOWNS];
        for j in 0..SIDE {
            let v = offset(j) / HALF as f64;
            for i in 0..SIDE {
                let u = offset(i) / HALF as f64;
                let gx = 0.5 * (values[j + 1][i + 2] - values[j + 1][i]);
                let gy = 0.5 * (values[j + 2][i + 1] - values[j][i + 1]);
                columns[0][j][i] = gx;
                columns[1][j][i] = gy;
                columns[2][j][i] = u * gx;
                columns[3][j][i] = v * gx;
                columns[4][j][i] = values[j + 1][i + 1] - mean;
                columns[5][j][i] = 1.0;
                let level = values[j + 1][i + 1] + BELOW_BLACK;
                columns[6][j][i] = u * level;
                columns[7][j][i] = v * level;
            }
        }
        Self(columns)
    }

    #[inline(always)]
    pub(super) fn normal_matrix(&self) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
        let mut normal = SMatrix::zeros();
        for (i, column) in self.0.iter().enumerate() {
            let weighted = weighted(column);
            for (k, other) in self.0.iter().enumerate().skip(i) {
                let product = dot(&weighted, other);
                (normal[(i, k)], normal[(k, i)]) = (product, product);
            }
        }
        normal
    }

    #[inline(always)]
    pub(super) fn project(&self, values: &Patch) -> SVector<f64, UNKNOWNS> {
        let mut projected = SVector::<f64, UNKNOWNS>::zeros();
        let weighted = weighted(values);
        for (projected, column) in projected.iter_mut().zip(&self.0) {
            *projected = dot(&weighted, column);
        }
        projected
    }

    /// Correlation of the model with `values`, and the variance of the residuals.
    #[inline(always)]
    pub(super) fn quality(&self, values: &Patch, solution: &SVector<f64, UNKNOWNS>) -> (f64, f64) {
        let total: f64 = WEIGHTS.iter().flatten().sum();
        let mean = dot(&WEIGHTS, values) / total;
        let (mut left_over, mut spread) = (0.0, 0.0);
        for (j, (values, weights)) in values.iter().zip(&*WEIGHTS).enumerate() {
            for (i, (value, weight)) in values.iter().zip(weights).enumerate() {
                let model: f64 = self.0.iter().zip(solution).map(|(column, factor)| column[j][i] * factor).sum();
                left_over += weight * (value - model).powi(2);
                spread += weight * (value - mean).powi(2);
            }
        }
        let correlation = (1.0 - left_over / spread.max(f64::MIN_POSITIVE)).max(0.0).sqrt();
        (correlation, left_over / total)
    }
}

/// The window's Gaussian weights.
static WEIGHTS: LazyLock<Patch> = LazyLock::new(|| {
    let weight = |x: f64, y: f64| (-0.5 * (x * x + y * y) / (WEIGHT_SIGMA * WEIGHT_SIGMA)).exp();
    std::array::from_fn(|j| std::array::from_fn(|i| weight(offset(i), offset(j))))
});

/// Samples `image` at the warped window around `at`; `None` where it is not all inside.
#[inline(always)]
pub(super) fn warped(image: &Plane, at: ViewPixel, warp: &Warp) -> Option<Patch> {
    let mut values = [[0.0; SIDE]; SIDE];
    for (j, row) in values.iter_mut().enumerate() {
        // A row of the window stays a row, because y' does not depend on x.
        let (x, y) = warp.apply(offset(0), offset(j));
        let found = image.sample_row::<SIDE>(at.x + x, 1.0 + warp.sx, at.y + y)?;
        row.iter_mut().zip(found).for_each(|(value, found)| *value = f64::from(found));
    }
    Some(values)
}

#[inline(always)]
fn weighted(values: &Patch) -> Patch {
    let mut weighted = *values;
    for (row, weights) in weighted.iter_mut().zip(&*WEIGHTS) {
        row.iter_mut().zip(weights).for_each(|(value, weight)| *value *= weight);
    }
    weighted
}

/// The sum of products, by columns first, so that the compiler can vectorise it.
#[inline(always)]
fn dot(a: &Patch, b: &Patch) -> f64 {
    let mut sums = [0.0; SIDE];
    for (a, b) in a.iter().zip(b) {
        for i in 0..SIDE {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().sum()
}

/// The offset of a row or column of the window from its centre.
#[inline(always)]
const fn offset(k: usize) -> f64 {
    k as f64 - HALF as f64
}
