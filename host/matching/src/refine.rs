//! Least-squares registration of the surroundings of a match, to a few hundredths of a pixel.
//!
//! Inverse compositional Gauss-Newton (S. Baker and I. Matthews, "Lucas-Kanade 20 years on", IJCV 56(3), 2004) with
//! gain and bias as linear unknowns. Between two views with epipolar rows a plane maps by x' = x + t_x + s_x x + s_y y,
//! y' = y: rows stay rows. t_y takes up the error of the pose and tells how far off the epipolar curve a match is.

use std::sync::LazyLock;

use multiversion::multiversion;
use nalgebra::{SMatrix, SVector};

use crate::plane::{Plane, Pyramid};
use crate::{Drop, ViewPixel};

/// A match after registration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registered {
    /// Where the right view shows what the left view shows at the keypoint.
    pub right: ViewPixel,
    /// Correlation of the two patches.
    pub correlation: f64,
}

/// Half the window's side, in pixels of the level.
const HALF: usize = 8;
const SIDE: usize = 2 * HALF + 1;
/// Width of the Gaussian that weighs the window.
const WEIGHT_SIGMA: f64 = 4.5;
const ITERATIONS: usize = 20;
/// A step this small, in pixels, ends the iteration.
const CONVERGED: f64 = 0.01;
/// Farthest a registration may move in one level, in its pixels.
const FARTHEST: f64 = 3.0;
/// Most stretch or shear along the row.
const STEEPEST: f64 = 0.6;
const LEAST_CORRELATION: f64 = 0.9;
/// Largest standard deviation of t_x in pixels.
const LARGEST_SIGMA: f64 = 0.15;
/// Largest distance between a keypoint and where the way there and back ends, in pixels.
const LARGEST_LOOP: f64 = 0.15;

/// Registers the surroundings of `right` to those of the keypoint `left`, from `level` down to the finest.
///
/// # Errors
/// The reason why the match is not to be trusted.
pub(crate) fn register(
    [left_levels, right_levels]: [&Pyramid; 2],
    left: ViewPixel,
    right: ViewPixel,
    level: usize,
) -> Result<Registered, Drop> {
    let mut warp = Warp { tx: right.x - left.x, ty: right.y - left.y, ..Warp::default() };
    let mut fit = Fit { warp, correlation: 0.0, sigma: f64::INFINITY };
    for level in (0..=level).rev() {
        let (Some(from), Some(to)) = (left_levels.levels().get(level), right_levels.levels().get(level)) else {
            return Err(Drop::NotRefined);
        };
        let scale = (1_usize << level) as f64;
        let at = ViewPixel { x: left.x / scale, y: left.y / scale };
        fit = align(from, to, at, warp.scaled(1.0 / scale))?;
        warp = fit.warp.scaled(scale);
    }
    if fit.correlation < LEAST_CORRELATION {
        return Err(Drop::LowCorrelation);
    }
    if fit.sigma > LARGEST_SIGMA {
        return Err(Drop::Uncertain);
    }
    let right = ViewPixel { x: left.x + warp.tx, y: left.y + warp.ty };
    let (Some(from), Some(to)) = (right_levels.levels().first(), left_levels.levels().first()) else {
        return Err(Drop::NotRefined);
    };
    let back = align(from, to, right, warp.inverse()).map_err(|_| Drop::NotReversible)?.warp;
    if (back.tx + warp.tx).hypot(back.ty + warp.ty) > LARGEST_LOOP {
        return Err(Drop::NotReversible);
    }
    Ok(Registered { right, correlation: fit.correlation })
}

/// x' = x + tx + sx x + sy y, y' = y + ty, about the centre of the window.
#[derive(Clone, Copy, Debug, Default)]
struct Warp {
    tx: f64,
    ty: f64,
    sx: f64,
    sy: f64,
}

impl Warp {
    fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        (x + self.tx + self.sx * x + self.sy * y, y + self.ty)
    }

    /// The same warp in pixels `factor` times as many.
    fn scaled(&self, factor: f64) -> Self {
        Self { tx: self.tx * factor, ty: self.ty * factor, ..*self }
    }

    /// The way back as seen from the warped centre.
    fn inverse(&self) -> Self {
        let stretch = 1.0 + self.sx;
        Self { tx: -self.tx, ty: -self.ty, sx: 1.0 / stretch - 1.0, sy: -self.sy / stretch }
    }

    /// This warp after undoing `step`.
    fn after_undoing(&self, step: &Self) -> Self {
        let stretch = 1.0 + step.sx;
        // The undone step maps x to (x − tx − sy (y − ty)) / stretch and y to y − ty.
        let (x0, xx, xy) = ((step.sy * step.ty - step.tx) / stretch, 1.0 / stretch, -step.sy / stretch);
        let (sx, sy) = (1.0 + self.sx, self.sy);
        Self { tx: self.tx + sx * x0 - sy * step.ty, ty: self.ty - step.ty, sx: sx * xx - 1.0, sy: sx * xy + sy }
    }
}

/// The result of a registration in one level.
struct Fit {
    warp: Warp,
    correlation: f64,
    /// Standard deviation of tx from the residuals.
    sigma: f64,
}

/// Number of unknowns: four of the warp, gain and bias.
const UNKNOWNS: usize = 6;

/// Registers `image` to the window of `template` around `at`, from the warp `start`.
#[multiversion(targets("x86_64+avx2"))]
fn align(template: &Plane, image: &Plane, at: ViewPixel, start: Warp) -> Result<Fit, Drop> {
    let window = Window::new(&surroundings(template, at).ok_or(Drop::NotRefined)?);
    let inverse = window.normal_matrix().cholesky().ok_or(Drop::Uncertain)?.inverse();
    let mut warp = start;
    for _ in 0..ITERATIONS {
        let values = warped(image, at, &warp).ok_or(Drop::NotRefined)?;
        let solution = inverse * window.project(&values);
        let gain = solution[4];
        if gain <= 0.0 {
            return Err(Drop::LowCorrelation);
        }
        let [tx, ty, sx, sy] = [0, 1, 2, 3].map(|i| solution[i] / gain);
        warp = warp.after_undoing(&Warp { tx, ty, sx: sx / HALF as f64, sy: sy / HALF as f64 });
        let moved = (warp.tx - start.tx).hypot(warp.ty - start.ty);
        let steep = warp.sx.abs().max(warp.sy.abs());
        if !(moved <= FARTHEST && steep <= STEEPEST) {
            return Err(Drop::NotRefined);
        }
        if tx.hypot(ty) < CONVERGED {
            let (correlation, variance) = window.quality(&values, &solution);
            let sigma = (variance * inverse[(0, 0)]).sqrt() / gain;
            return Ok(Fit { warp, correlation, sigma });
        }
    }
    Err(Drop::NotRefined)
}

/// One number for each pixel of the window, by rows.
type Patch = [[f64; SIDE]; SIDE];

/// The window with a pixel more on each side, for its gradients.
type Padded = [[f64; SIDE + 2]; SIDE + 2];

/// What `template` shows around `at`; `None` where it is not all inside.
#[inline(always)]
fn surroundings(template: &Plane, at: ViewPixel) -> Option<Padded> {
    let mut values = [[0.0; SIDE + 2]; SIDE + 2];
    for (j, row) in values.iter_mut().enumerate() {
        let found = template.sample_row::<{ SIDE + 2 }>(at.x + offset(0) - 1.0, 1.0, at.y + offset(j) - 1.0)?;
        row.iter_mut().zip(found).for_each(|(value, found)| *value = f64::from(found));
    }
    Some(values)
}

/// The template's window as the columns of a linear model of the other image's window:
/// I ≈ gain (T + ∇T · step) + bias.
struct Window([Patch; UNKNOWNS]);

impl Window {
    #[inline(always)]
    fn new(values: &Padded) -> Self {
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
            }
        }
        Self(columns)
    }

    #[inline(always)]
    fn normal_matrix(&self) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
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
    fn project(&self, values: &Patch) -> SVector<f64, UNKNOWNS> {
        let mut projected = SVector::<f64, UNKNOWNS>::zeros();
        let weighted = weighted(values);
        for (projected, column) in projected.iter_mut().zip(&self.0) {
            *projected = dot(&weighted, column);
        }
        projected
    }

    /// Correlation of the model with `values`, and the variance of the residuals.
    #[inline(always)]
    fn quality(&self, values: &Patch, solution: &SVector<f64, UNKNOWNS>) -> (f64, f64) {
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

/// `image` under the warped window around `at`; `None` where it is not all inside.
#[inline(always)]
fn warped(image: &Plane, at: ViewPixel, warp: &Warp) -> Option<Patch> {
    let mut values = [[0.0; SIDE]; SIDE];
    for (j, row) in values.iter_mut().enumerate() {
        // A row of the window stays one: y' does not depend on x.
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

/// The sum of products, by columns first so that the compiler may vectorise.
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

/// How far a row or column of the window is from its centre.
const fn offset(k: usize) -> f64 {
    k as f64 - HALF as f64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: usize = 64;

    /// Smooth texture without symmetry, seen under a warp about the middle of the plane.
    fn textured(warp: &Warp, gain: f64, bias: f64) -> Plane {
        let middle = (SIZE / 2) as f64;
        let undo = warp.inverse();
        let value = |x: f64, y: f64| {
            let (x, y) = (x - middle - warp.tx, y - middle - warp.ty);
            let (x, y) = (x + undo.sx * x + undo.sy * y, y);
            let waves = (0.45 * x + 0.2 * y).sin() + (0.3 * y - 0.25 * x + 1.0).cos() + (0.5 * y + 0.1 * x).sin();
            (128.0 + 30.0 * waves) * gain + bias
        };
        let values = (0..SIZE * SIZE).map(|i| value((i % SIZE) as f64, (i / SIZE) as f64) as f32).collect();
        Plane::new(SIZE, SIZE, values)
    }

    proptest! {
        #[test]
        fn undoing_a_warp_after_itself_leaves_nothing(
            tx in -3.0..3.0, ty in -3.0..3.0, sx in -0.5..0.5, sy in -0.5..0.5, x in -8.0..8.0, y in -8.0..8.0,
        ) {
            let warp = Warp { tx, ty, sx, sy };
            let (u, v) = warp.after_undoing(&warp).apply(x, y);
            prop_assert!((u - x).abs() < 1e-9 && (v - y).abs() < 1e-9);
        }

        #[test]
        fn a_known_warp_is_recovered_under_gain_and_bias(
            tx in -1.0..1.0, ty in -1.0..1.0, sx in -0.15..0.15, sy in -0.15..0.15, gain in 0.6..1.3, bias in -20.0..20.0,
        ) {
            let truth = Warp { tx, ty, sx, sy };
            let (template, image) = (textured(&Warp::default(), 1.0, 0.0), textured(&truth, gain, bias));
            let middle = ViewPixel { x: (SIZE / 2) as f64, y: (SIZE / 2) as f64 };
            let fit = align(&template, &image, middle, Warp::default()).unwrap();
            prop_assert!((fit.warp.tx - tx).abs() < 0.02 && (fit.warp.ty - ty).abs() < 0.02, "{:?}", fit.warp);
            prop_assert!((fit.warp.sx - sx).abs() < 0.01 && (fit.warp.sy - sy).abs() < 0.01, "{:?}", fit.warp);
            prop_assert!(fit.correlation > 0.99);
        }
    }

    #[test]
    fn a_flat_window_is_refused() {
        let flat = Plane::new(SIZE, SIZE, vec![90.0; SIZE * SIZE]);
        let middle = ViewPixel { x: 32.0, y: 32.0 };
        assert_eq!(align(&flat, &flat, middle, Warp::default()).err(), Some(Drop::Uncertain));
    }
}
