//! From whole disparities to fractions of a pixel, with what is uncertain about them.

use super::register::{Registration, Seen, register};
use super::surface::{Surface, surface};

/// Reach of the windows in which disparities are smoothed and views are registered, in pixels.
const REACH: usize = 4;
/// A registration that moves farther than this did not converge.
const MOST: f32 = 1.0;
/// Neighbouring remainders are alike, because views are interpolated: this many pixels tell as much as one.
const ALIKE: f32 = 4.0;
/// Standard deviation that interpolation leaves, whatever the contrast, in pixels.
const INTERPOLATION: f32 = 0.05;

/// The disparities of a left view, in its pixels; NaN where there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Disparities {
    pub(super) disparity: Vec<f32>,
    /// Standard deviation from noise, contrast, and how smooth the surface is.
    pub(super) sigma: Vec<f32>,
    /// Standard deviation because another surface is near.
    pub(super) edge: Vec<f32>,
    /// 0 to 1.
    pub(super) likeness: Vec<f32>,
}

/// Smooths and registers twice: the first pass brings slanted surfaces within the reach of the second.
pub(super) fn registered(eyes: [Seen<'_>; 2], whole: &[f32]) -> Disparities {
    let width = eyes[0].plane.width();
    let smooth = surface(whole, width, REACH);
    let moved = moved(&smooth, &register(eyes, &smooth.disparity, REACH));
    let smooth = surface(&moved, width, REACH);
    let registration = register(eyes, &smooth.disparity, REACH);
    let disparity = self::moved(&smooth, &registration);
    let sigma = registration.sigma.iter().zip(&smooth.roughness);
    let sigma =
        sigma.map(|(own, rough)| (ALIKE * own * own + 0.25 * rough * rough + INTERPOLATION * INTERPOLATION).sqrt());
    Disparities { disparity, sigma: sigma.collect(), edge: smooth.edge, likeness: registration.likeness }
}

/// The surface, moved where registration converged.
fn moved(surface: &Surface, registration: &Registration) -> Vec<f32> {
    let moved = |(&disparity, &shift): (&f32, &f32)| if shift.abs() <= MOST { disparity + shift } else { disparity };
    surface.disparity.iter().zip(&registration.shift).map(moved).collect()
}
