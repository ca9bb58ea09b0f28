//! Least-squares registration of the windows around a match, to a few hundredths of a pixel.
//!
//! The method is inverse compositional Gauss-Newton (S. Baker and I. Matthews, "Lucas-Kanade 20 years on", IJCV 56(3),
//! 2004) with gain, bias and the slope of the gain as linear unknowns. Between two views with epipolar rows a plane maps by
//! x' = x + t_x + s_x x + s_y y, y' = y, so rows stay rows. The unknown t_y absorbs the error of the pose; it is the
//! distance of the match from its epipolar curve.

mod warp;
mod window;

use multiversion::multiversion;

pub(crate) use self::warp::Warp;
use self::window::{HALF, Window, surroundings, warped};
use crate::match_errors::Evidence;
use crate::plane::{Plane, Pyramid};
use crate::{UnmatchedReason, ViewPixel};

/// The result of a registration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registered {
    /// The position in the right view that corresponds to the left keypoint.
    pub right: ViewPixel,
    /// Correlation of both windows.
    pub correlation: f64,
    /// What the registration shows of its error.
    pub evidence: Evidence,
}

/// A registration that is not good to a small part of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unregistered {
    /// Why it is not.
    pub reason: UnmatchedReason,
    /// Where it ended all the same; `None` where it did not converge.
    pub ended: Option<Registered>,
}

impl From<UnmatchedReason> for Unregistered {
    fn from(reason: UnmatchedReason) -> Self {
        Self { reason, ended: None }
    }
}

const ITERATIONS: usize = 20;
/// Length of a step, in pixels, that ends the iteration.
const CONVERGED: f64 = 0.01;
/// Largest movement of a registration within one level, in its pixels.
const FARTHEST: f64 = 3.0;
/// Largest stretch or shear along the row.
const STEEPEST: f64 = 0.6;
const LEAST_CORRELATION: f64 = 0.9;
/// Largest standard deviation of t_x from the residuals, in pixels.
const LARGEST_SIGMA: f64 = 0.15;
/// Largest distance in pixels between a keypoint and the result of registering to the right view and back.
const LARGEST_LOOP: f64 = 0.15;

/// Registers the right view around `right` to the left view around the keypoint `left`, from `level` down to the
/// finest.
///
/// # Errors
/// Why the result is not good to a small part of a pixel, with the result where there is one.
pub(crate) fn register(
    [left_levels, right_levels]: [&Pyramid; 2],
    left: ViewPixel,
    right: ViewPixel,
    level: usize,
) -> Result<Registered, Unregistered> {
    let mut warp = Warp { tx: right.x - left.x, ty: right.y - left.y, ..Warp::default() };
    let mut fit = Fit { warp, correlation: 0.0, sigmas: [f64::INFINITY; 2], residual: f64::INFINITY };
    for level in (0..=level).rev() {
        let (Some(from), Some(to)) = (left_levels.levels().get(level), right_levels.levels().get(level)) else {
            return Err(UnmatchedReason::NotRefined.into());
        };
        let scale = (1_usize << level) as f64;
        let at = ViewPixel { x: left.x / scale, y: left.y / scale };
        fit = align(from, to, at, warp.scaled(1.0 / scale))?;
        warp = fit.warp.scaled(scale);
    }
    if fit.correlation < LEAST_CORRELATION {
        return Err(UnmatchedReason::LowCorrelation.into());
    }
    let right = ViewPixel { x: left.x + warp.tx, y: left.y + warp.ty };
    let (Some(from), Some(to)) = (right_levels.levels().first(), left_levels.levels().first()) else {
        return Err(UnmatchedReason::NotRefined.into());
    };
    let steepness = warp.sx.abs().max(warp.sy.abs());
    let ended = |way_back: f64| {
        let evidence = Evidence { from_residuals: fit.sigmas, residual: fit.residual, steepness, way_back, warp };
        Registered { right, correlation: fit.correlation, evidence }
    };
    if fit.sigmas[0] > LARGEST_SIGMA {
        return Err(Unregistered { reason: UnmatchedReason::Uncertain, ended: Some(ended(f64::INFINITY)) });
    }
    let way_back = align(from, to, right, warp.inverse())
        .map_or(f64::INFINITY, |back| (back.warp.tx + warp.tx).hypot(back.warp.ty + warp.ty));
    if way_back > LARGEST_LOOP {
        return Err(Unregistered { reason: UnmatchedReason::NotReversible, ended: Some(ended(way_back)) });
    }
    Ok(ended(way_back))
}

/// Distance of the windows beside a match from its own, in pixels of the view: most of what they show is the same surface.
const BESIDE: f64 = 7.0;
/// The departure of a window that cannot be registered.
const LOST: f64 = f64::INFINITY;

/// How far the disparities to the left, to the right, above and below the match `left` depart from the plane that its registration found,
/// in pixels of the view. A window that shows two surfaces finds a plane between them that the windows beside it do not.
pub(crate) fn departures([left_levels, right_levels]: [&Pyramid; 2], left: ViewPixel, warp: &Warp) -> [f64; 4] {
    let planes = left_levels.levels().first().zip(right_levels.levels().first());
    [(-BESIDE, 0.0), (BESIDE, 0.0), (0.0, -BESIDE), (0.0, BESIDE)].map(|(dx, dy)| {
        let there = ViewPixel { x: left.x + dx, y: left.y + dy };
        let on_plane = Warp { tx: warp.tx + warp.sx * dx + warp.sy * dy, ..*warp };
        let found = planes.and_then(|(from, to)| align(from, to, there, on_plane).ok());
        found.map_or(LOST, |found| (found.warp.tx - on_plane.tx).abs())
    })
}

/// The result of a registration in one level.
struct Fit {
    warp: Warp,
    correlation: f64,
    /// Standard deviations of tx and ty from the residuals, in pixels of the level.
    sigmas: [f64; 2],
    /// Root mean square of the residuals, in grey levels.
    residual: f64,
}

/// Registers `image` to the window of `template` around `at`, starting with the warp `start`.
#[multiversion(targets("x86_64+avx2"))]
fn align(template: &Plane, image: &Plane, at: ViewPixel, start: Warp) -> Result<Fit, UnmatchedReason> {
    let mut window = Window::empty();
    window.fill(&surroundings(template, at).ok_or(UnmatchedReason::NotRefined)?);
    let inverse = window.normal_matrix().cholesky().ok_or(UnmatchedReason::Uncertain)?.inverse();
    let mut warp = start;
    for _ in 0..ITERATIONS {
        let values = warped(image, at, &warp).ok_or(UnmatchedReason::NotRefined)?;
        let solution = inverse * window.project(&values);
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
        if tx.hypot(ty) < CONVERGED {
            let (correlation, variance) = window.quality(&values, &solution);
            let sigmas = [0, 1].map(|i| (variance * inverse[(i, i)]).sqrt() / gain);
            return Ok(Fit { warp, correlation, sigmas, residual: variance.sqrt() });
        }
    }
    Err(UnmatchedReason::NotRefined)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: usize = 64;

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

    proptest! {
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
