//! A window prepared for registration, and the iteration that registers other planes to it.

use multiversion::multiversion;
use nalgebra::{SMatrix, SVector};

use super::warp::Warp;
use super::window::{HALF, Patch, UNKNOWNS, Window, surroundings, warped};
use crate::plane::Plane;
use crate::{UnmatchedReason, ViewPixel};

const ITERATIONS: usize = 20;
/// Length of a step, in pixels, that ends the iteration.
const CONVERGED: f64 = 0.01;
/// What the stretch and shear of such a step may move the edge of the window by, in pixels.
const SETTLED: f64 = 0.1;
/// Largest movement of a registration within one level, in its pixels.
const FARTHEST: f64 = 3.0;
/// Largest stretch or shear along the row.
const STEEPEST: f64 = 0.6;

/// The window of a plane around a place, with all that does not depend on what is registered to it.
pub(super) struct Template {
    at: ViewPixel,
    window: Window,
    /// Inverse of the normal matrix.
    inverse: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

/// The result of a registration in one level.
pub(super) struct Fit {
    pub warp: Warp,
    pub correlation: f64,
    /// Standard deviations of tx and ty from the residuals, in pixels of the level.
    pub sigmas: [f64; 2],
    /// Root mean square of the residuals, in grey levels.
    pub residual: f64,
}

impl Template {
    /// A window without content, to be prepared in place.
    pub(super) fn empty() -> Self {
        Self { at: ViewPixel { x: 0.0, y: 0.0 }, window: Window::empty(), inverse: SMatrix::zeros() }
    }

    /// Takes the window of `plane` around `at`.
    pub(super) fn prepare(&mut self, plane: &Plane, at: ViewPixel) -> Result<(), UnmatchedReason> {
        prepare(self, plane, at)
    }

    /// The warp under which `image` shows this window, found from `start` on.
    pub(super) fn settle(&self, image: &Plane, start: Warp) -> Result<Warp, UnmatchedReason> {
        settle(self, image, start)
    }

    /// The same, with how well it does.
    pub(super) fn fit(&self, image: &Plane, start: Warp) -> Result<Fit, UnmatchedReason> {
        fit(self, image, start)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn prepare(template: &mut Template, plane: &Plane, at: ViewPixel) -> Result<(), UnmatchedReason> {
    template.at = at;
    template.window.fill(&surroundings(plane, at).ok_or(UnmatchedReason::NotRefined)?);
    let normal = template.window.normal_matrix();
    template.inverse = normal.cholesky().ok_or(UnmatchedReason::Uncertain)?.inverse();
    Ok(())
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn settle(template: &Template, image: &Plane, start: Warp) -> Result<Warp, UnmatchedReason> {
    Ok(iterate(template, image, start)?.0)
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn fit(template: &Template, image: &Plane, start: Warp) -> Result<Fit, UnmatchedReason> {
    let (warp, values, solution) = iterate(template, image, start)?;
    let (correlation, variance) = template.window.quality(&values, &solution);
    let sigmas = [0, 1].map(|i| (variance * template.inverse[(i, i)]).sqrt() / solution[4]);
    Ok(Fit { warp, correlation, sigmas, residual: variance.sqrt() })
}

/// The last warp, the values under the one before it, and the solution of the last step.
#[inline(always)]
fn iterate(
    template: &Template,
    image: &Plane,
    start: Warp,
) -> Result<(Warp, Patch, SVector<f64, UNKNOWNS>), UnmatchedReason> {
    let mut warp = start;
    for _ in 0..ITERATIONS {
        let values = warped(image, template.at, &warp).ok_or(UnmatchedReason::NotRefined)?;
        let solution = template.inverse * template.window.project(&values);
        let gain = solution[4];
        if gain <= 0.0 {
            return Err(UnmatchedReason::LowCorrelation);
        }
        let [tx, ty, sx, sy] = [0, 1, 2, 3].map(|i| solution[i] / gain);
        warp = warp.after_undoing(&Warp { tx, ty, sx: sx / HALF as f64, sy: sy / HALF as f64 });
        let moved = (warp.tx - start.tx).hypot(warp.ty - start.ty);
        let steep = warp.sx.abs().max(warp.sy.abs());
        if !(moved <= FARTHEST && steep <= STEEPEST) {
            return Err(UnmatchedReason::NotRefined);
        }
        if tx.hypot(ty) < CONVERGED && sx.hypot(sy) < SETTLED {
            return Ok((warp, values, solution));
        }
    }
    Err(UnmatchedReason::NotRefined)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: usize = 64;

    fn align(template: &Plane, image: &Plane, at: ViewPixel, start: Warp) -> Result<Fit, UnmatchedReason> {
        let mut prepared = Template::empty();
        prepared.prepare(template, at)?;
        prepared.fit(image, start)
    }

    /// Smooth texture without symmetry, under a warp about the middle of the plane.
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

    /// Registers a texture under `truth` to itself and compares.
    fn is_recovered(truth: Warp, gain: f64, bias: f64) -> Result<(), TestCaseError> {
        let Warp { tx, ty, sx, sy } = truth;
        let (template, image) = (textured(&Warp::default(), 1.0, 0.0), textured(&truth, gain, bias));
        let middle = ViewPixel { x: (SIZE / 2) as f64, y: (SIZE / 2) as f64 };
        let fit = align(&template, &image, middle, Warp::default()).unwrap();
        prop_assert!((fit.warp.tx - tx).abs() < 0.02 && (fit.warp.ty - ty).abs() < 0.02, "{:?}", fit.warp);
        prop_assert!((fit.warp.sx - sx).abs() < 0.01 && (fit.warp.sy - sy).abs() < 0.01, "{:?}", fit.warp);
        prop_assert!(fit.correlation > 0.99);
        Ok(())
    }

    proptest! {
        #[test]
        fn a_known_warp_is_recovered_under_gain_and_bias(
            tx in -1.0..1.0, ty in -1.0..1.0, sx in -0.15..0.15, sy in -0.15..0.15, gain in 0.6..1.3, bias in -20.0..20.0,
        ) {
            is_recovered(Warp { tx, ty, sx, sy }, gain, bias)?;
        }

        /// One in some thousand warps of the law above: the first step displaced next to nothing, and ended the iteration with the shear 0.02 off.
        #[test]
        fn a_shear_is_recovered_where_hardly_anything_is_displaced(
            tx in -0.01..0.01, ty in -0.01..0.01, sx in -0.15..0.15, sy in -0.15..0.15, gain in 0.6..1.3,
        ) {
            is_recovered(Warp { tx, ty, sx, sy }, gain, 0.0)?;
        }
    }

    /// `plane` under light that grows by these parts per pixel; levels are 14 more than the light of sRGB is proportional to.
    fn under_falloff(plane: &Plane, [by_x, by_y]: [f64; 2]) -> Plane {
        let middle = (SIZE / 2) as f64;
        let darkened = |(i, value): (usize, &f32)| {
            let (x, y) = ((i % SIZE) as f64 - middle, (i / SIZE) as f64 - middle);
            ((f64::from(*value) + 14.0) * (1.0 + by_x * x + by_y * y) - 14.0) as f32
        };
        Plane::new(SIZE, SIZE, plane.values().iter().enumerate().map(darkened).collect())
    }

    proptest! {
        #[test]
        fn a_lens_that_darkens_towards_its_edge_displaces_nothing(by_x in -2e-3..2e-3, by_y in -2e-3..2e-3) {
            let template = textured(&Warp::default(), 1.0, 0.0);
            let image = under_falloff(&template, [by_x, by_y]);
            let middle = ViewPixel { x: (SIZE / 2) as f64, y: (SIZE / 2) as f64 };
            let fit = align(&template, &image, middle, Warp::default()).unwrap();
            prop_assert!(fit.warp.tx.hypot(fit.warp.ty) < 1e-4, "{:?}", fit.warp);
        }
    }

    #[test]
    fn a_flat_window_is_refused() {
        let flat = Plane::new(SIZE, SIZE, vec![90.0; SIZE * SIZE]);
        let middle = ViewPixel { x: 32.0, y: 32.0 };
        assert_eq!(align(&flat, &flat, middle, Warp::default()).err(), Some(UnmatchedReason::Uncertain));
    }
}
