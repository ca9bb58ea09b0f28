//! Refinement of whole disparities to fractions of a pixel, with their standard deviation.

use super::register::{Registration, SampledView, register};
use super::surface::{Surface, surface};

/// Reach of the windows for smoothing and registration, in pixels of the view.
const REACH: usize = 4;
/// Largest shift of a registration in pixels; a larger one did not converge.
const MOST: f32 = 1.0;
/// Number of pixels that count as one observation: residuals of neighbours are correlated, because views are
/// interpolated.
const ALIKE: f32 = 4.0;
/// Standard deviation in pixels that interpolation leaves at any contrast.
const INTERPOLATION: f32 = 0.05;

/// The disparities of a left view with their standard deviations, in pixels of the view; NaN where there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Disparities {
    pub(super) disparity: Vec<f32>,
    /// Standard deviation from noise, contrast and the roughness of the surface.
    pub(super) sigma: Vec<f32>,
    /// Standard deviation from another surface within the window.
    pub(super) edge: Vec<f32>,
    /// Fraction of the left window's contrast that the right one explains, 0 to 1.
    pub(super) likeness: Vec<f32>,
}

/// Smooths and registers twice. The first pass brings slanted surfaces within the reach of the second.
pub(super) fn registered(views: [SampledView<'_>; 2], whole: &[f32]) -> Disparities {
    let width = views[0].plane.width();
    let smooth = surface(whole, width, REACH);
    let moved = moved(&smooth, &register(views, &smooth.disparity, REACH));
    let smooth = surface(&moved, width, REACH);
    let registration = register(views, &smooth.disparity, REACH);
    let disparity = self::moved(&smooth, &registration);
    let sigma = registration.sigma.iter().zip(&smooth.roughness);
    let sigma =
        sigma.map(|(own, rough)| (ALIKE * own * own + 0.25 * rough * rough + INTERPOLATION * INTERPOLATION).sqrt());
    Disparities { disparity, sigma: sigma.collect(), edge: smooth.edge, likeness: registration.likeness }
}

/// The disparities of the surface, shifted where registration converged.
fn moved(surface: &Surface, registration: &Registration) -> Vec<f32> {
    let moved = |(&disparity, &shift): (&f32, &f32)| if shift.abs() <= MOST { disparity + shift } else { disparity };
    surface.disparity.iter().zip(&registration.shift).map(moved).collect()
}
