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
const WEIGHT_SIGMA: f32 = 4.5;
/// Number of unknowns: four of the warp, gain, bias, and how the gain grows along and across the row.
pub(super) const UNKNOWNS: usize = 8;
/// Grey level below black at which sRGB, 1.055 L^(1/2.4) - 0.055 of the light L, would begin without its straight part (IEC 61966-2-1):
/// above it levels grow in proportion where the light does.
const BELOW_BLACK: f32 = 255.0 * 0.055;
/// Pixels that are summed at once.
const LANES: usize = 8;

/// One value for each pixel of the window, by rows, and some of weight zero.
///
/// Values are grey levels from that of the middle on: single precision then keeps sums of their products to a millionth.
pub(super) type Patch = [[f32; LANES]; (SIDE * SIDE).div_ceil(LANES)];
const EMPTY: Patch = [[0.0; LANES]; (SIDE * SIDE).div_ceil(LANES)];

/// The values of the window with one more pixel on each side, for gradients.
pub(super) type Padded = [[f32; SIDE + 2]; SIDE + 2];

/// Samples `template` around `at`; `None` where the window is not all inside.
#[inline(always)]
pub(super) fn surroundings(template: &Plane, at: ViewPixel) -> Option<Padded> {
    let mut values = [[0.0; SIDE + 2]; SIDE + 2];
    for (j, row) in values.iter_mut().enumerate() {
        let (x, y) = (f64::from(offset(0)) - 1.0, f64::from(offset(j)) - 1.0);
        *row = template.sample_row::<{ SIDE + 2 }>(at.x + x, 1.0, at.y + y)?;
    }
    Some(values)
}

/// The template's window as the columns of a linear model of the other image's window:
/// I ≈ gain (T + ∇T · step) + bias + slope · (x, y) (T + 14).
///
/// The slope is that of the falloff of a lens: towards the edge of its field it darkens, in the two images of a point in different
/// directions. Without it the window seems displaced towards the brighter side by some thousandths of a pixel, all windows of a region alike
/// (docs/measured/robot.md).
pub(super) struct Window {
    columns: [Patch; UNKNOWNS],
    /// The same times the weights.
    weighted: [Patch; UNKNOWNS],
}

impl Window {
    /// A window without content, to be filled in place: it is too large to be moved about.
    pub(super) const fn empty() -> Self {
        Self { columns: [EMPTY; UNKNOWNS], weighted: [EMPTY; UNKNOWNS] }
    }

    #[inline(always)]
    pub(super) fn fill(&mut self, values: &Padded) {
        let mean = values[HALF + 1][HALF + 1];
        let [by_x, by_y, by_ux, by_vx, level, one, by_u, by_v] =
            self.columns.each_mut().map(|it| it.as_flattened_mut());
        for j in 0..SIDE {
            let v = offset(j) / HALF as f32;
            let row = SIDE * j..SIDE * (j + 1);
            let (by_x, by_y) = (&mut by_x[row.clone()], &mut by_y[row.clone()]);
            let (by_ux, by_vx) = (&mut by_ux[row.clone()], &mut by_vx[row.clone()]);
            let (level, one) = (&mut level[row.clone()], &mut one[row.clone()]);
            let (by_u, by_v) = (&mut by_u[row.clone()], &mut by_v[row]);
            let (above, here, below) = (&values[j], &values[j + 1], &values[j + 2]);
            for i in 0..SIDE {
                let u = offset(i) / HALF as f32;
                let gx = 0.5 * (here[i + 2] - here[i]);
                (by_x[i], by_y[i]) = (gx, 0.5 * (below[i + 1] - above[i + 1]));
                (by_ux[i], by_vx[i]) = (u * gx, v * gx);
                (level[i], one[i]) = (here[i + 1] - mean, 1.0);
                let light = here[i + 1] + BELOW_BLACK;
                (by_u[i], by_v[i]) = (u * light, v * light);
            }
        }
        let weights: &Patch = &WEIGHTS;
        for (weighted, column) in self.weighted.iter_mut().zip(&self.columns) {
            for c in 0..weights.len() {
                for l in 0..LANES {
                    weighted[c][l] = column[c][l] * weights[c][l];
                }
            }
        }
    }

    /// The lower triangle of the normal matrix and its diagonal, which is all of it that its factors need.
    #[inline(always)]
    pub(super) fn normal_matrix(&self) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
        let mut normal = SMatrix::zeros();
        for (i, column) in self.columns.iter().enumerate().take(UNKNOWNS / 2) {
            let products = self.products::<{ UNKNOWNS / 2 }>(column);
            products.into_iter().enumerate().take(i + 1).for_each(|(k, product)| normal[(i, k)] = product);
        }
        for (i, column) in self.columns.iter().enumerate().skip(UNKNOWNS / 2) {
            let products = self.products::<UNKNOWNS>(column);
            products.into_iter().enumerate().take(i + 1).for_each(|(k, product)| normal[(i, k)] = product);
        }
        normal
    }

    #[inline(always)]
    pub(super) fn project(&self, values: &Patch) -> SVector<f64, UNKNOWNS> {
        SVector::from(self.products(values))
    }

    /// The sums of products of `values` with the first weighted columns, all at once.
    #[inline(always)]
    fn products<const N: usize>(&self, values: &Patch) -> [f64; N] {
        let mut sums = [[0.0_f32; LANES]; N];
        for (c, values) in values.iter().enumerate() {
            for (sums, column) in sums.iter_mut().zip(&self.weighted) {
                for l in 0..LANES {
                    sums[l] += column[c][l] * values[l];
                }
            }
        }
        sums.map(|lanes| lanes.into_iter().map(f64::from).sum())
    }

    /// Correlation of the model with `values`, and the variance of the residuals.
    #[inline(always)]
    pub(super) fn quality(&self, values: &Patch, solution: &SVector<f64, UNKNOWNS>) -> (f64, f64) {
        let weights: &Patch = &WEIGHTS;
        let [_, sum, total] = sums(weights, values);
        let mean = (sum / total) as f32;
        let mut left = EMPTY;
        for c in 0..left.len() {
            let mut model = [0.0_f32; LANES];
            for (column, factor) in self.columns.iter().zip(solution) {
                let factor = *factor as f32;
                for l in 0..LANES {
                    model[l] += column[c][l] * factor;
                }
            }
            for l in 0..LANES {
                left[c][l] = values[c][l] - model[l];
            }
        }
        let mut centred = *values;
        centred.as_flattened_mut().iter_mut().for_each(|value| *value -= mean);
        let ([left_over, ..], [spread, ..]) = (sums(weights, &left), sums(weights, &centred));
        let correlation = (1.0 - left_over / spread.max(f64::MIN_POSITIVE)).max(0.0).sqrt();
        (correlation, left_over / total)
    }
}

/// The weighted sums of the squares of `values`, of `values`, and of one.
#[inline(always)]
fn sums(weights: &Patch, values: &Patch) -> [f64; 3] {
    let mut sums = [[0.0_f32; LANES]; 3];
    for (weights, values) in weights.iter().zip(values) {
        for l in 0..LANES {
            let weighted = weights[l] * values[l];
            sums[0][l] += weighted * values[l];
            sums[1][l] += weighted;
            sums[2][l] += weights[l];
        }
    }
    sums.map(|lanes| lanes.into_iter().map(f64::from).sum())
}

/// The window's Gaussian weights.
static WEIGHTS: LazyLock<Patch> = LazyLock::new(|| {
    let mut weights = EMPTY;
    for (index, weight) in weights.as_flattened_mut().iter_mut().take(SIDE * SIDE).enumerate() {
        let (x, y) = (offset(index % SIDE), offset(index / SIDE));
        *weight = (-0.5 * (x * x + y * y) / (WEIGHT_SIGMA * WEIGHT_SIGMA)).exp();
    }
    weights
});

/// Samples `image` at the warped window around `at`; `None` where it is not all inside.
#[inline(always)]
pub(super) fn warped(image: &Plane, at: ViewPixel, warp: &Warp) -> Option<Patch> {
    let mut patch = EMPTY;
    let values = patch.as_flattened_mut();
    for j in 0..SIDE {
        // A row of the window stays a row, because y' does not depend on x.
        let (x, y) = warp.apply(f64::from(offset(0)), f64::from(offset(j)));
        let found = image.sample_row::<SIDE>(at.x + x, 1.0 + warp.sx, at.y + y)?;
        values[SIDE * j..][..SIDE].copy_from_slice(&found);
    }
    let middle = values[SIDE * HALF + HALF];
    values[..SIDE * SIDE].iter_mut().for_each(|value| *value -= middle);
    Some(patch)
}

/// The offset of a row or column of the window from its centre.
#[inline(always)]
const fn offset(k: usize) -> f32 {
    k as f32 - HALF as f32
}
