//! Refinement of whole disparities to fractions of a pixel, with their standard deviation, and what is wrong with them.

use rayon::prelude::*;

use super::Gap;
use super::edges::steps;
use super::register::{Registration, SampledView, register};
use super::support::isolated;
use super::surface::{SAME_SURFACE, Surface, surface};

/// Reach of the windows for smoothing and registration, in pixels of the view.
const REACH: usize = 4;
/// Largest shift of a registration in pixels; a larger one did not converge.
const MOST: f32 = 1.0;
/// Largest standard deviation of a registration that is used, in pixels.
const LARGEST_SIGMA: f32 = 1.0;
/// Smallest fraction of contrast that two windows of one surface have in common.
const LEAST_LIKENESS: f32 = 0.4;
/// Smallest surface, in pixels of the coarsest level of the search: smaller patches are mostly wrong.
const SMALLEST: usize = 100;
/// Standard deviation of a disparity, in pixels, from the roughness of its surface: the factor, and its growth per
/// pixel. Chosen, with the constants beside it, so that 68 and 95 % of the errors are within one and two standard
/// deviations in rendered scenes (docs/measured/dense.md).
const BY_ROUGHNESS: [f32; 2] = [1.1, 1.5];
/// Standard deviation in pixels that interpolation leaves at any contrast.
const INTERPOLATION: f32 = 0.02;
/// Standard deviation of the range of a pixel with another surface in its window, as a part of the difference of both ranges: a part of these
/// pixels is the other surface's, and those are then within two standard deviations.
pub(super) const BETWEEN_SURFACES: f32 = 0.6;

/// The disparities of a left view with their standard deviations, in pixels of the view; NaN where there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Disparities {
    pub(super) disparity: Vec<f32>,
    /// Standard deviation from noise, contrast, the roughness of the surface and near edges.
    pub(super) sigma: Vec<f32>,
    /// Fraction of the left window's contrast that the right one explains, 0 to 1.
    pub(super) likeness: Vec<f32>,
    /// The disparity of another surface that the pixel may belong to; NaN where there is none but small steps.
    pub(super) other: Vec<f32>,
    /// Why a disparity is not used.
    pub(super) doubt: Vec<Option<Gap>>,
}

/// Smooths and registers twice. The first pass brings slanted surfaces within the reach of the second. `area` is that of
/// a pixel of the coarsest level of the search.
pub(super) fn registered(views: [SampledView<'_>; 2], whole: &[f32], area: usize) -> Disparities {
    let width = views[0].plane.width();
    let smooth = surface(whole, width, REACH);
    let moved = moved(&smooth, &register(views, &smooth.disparity, REACH));
    let smooth = surface(&moved, width, REACH);
    let registration = register(views, &smooth.disparity, REACH);
    let disparity = self::moved(&smooth, &registration);
    let mut doubt: Vec<Option<Gap>> = registration.sigma.iter().zip(&registration.likeness).map(by_window).collect();
    let small = isolated(&trusted(&disparity, &doubt), width, (SMALLEST * area) as u32);
    for (doubt, _) in doubt.iter_mut().zip(&small).filter(|(doubt, small)| doubt.is_none() && **small) {
        *doubt = Some(Gap::Isolated);
    }
    let steps = steps(&trusted(&disparity, &doubt), views[0].seen, width);
    let own = registration.sigma.par_iter().zip(&smooth.roughness).zip(&steps);
    let sigma = own.map(|((own, roughness), step)| sigma_of(*own, *roughness, *step)).collect();
    let others = disparity.par_iter().zip(&steps);
    let other = others.map(|(own, step)| if step.abs() > SAME_SURFACE { own + step } else { f32::NAN }).collect();
    Disparities { disparity, sigma, likeness: registration.likeness, other, doubt }
}

/// What the registration of a window says against its result.
fn by_window((sigma, likeness): (&f32, &f32)) -> Option<Gap> {
    if !sigma.is_finite() || *sigma > LARGEST_SIGMA {
        Some(Gap::Untextured)
    } else if *likeness < LEAST_LIKENESS {
        Some(Gap::Inconsistent)
    } else {
        None
    }
}

/// The standard deviation of a disparity from that of its registration, from the roughness of its surface, and from a small `step` in its window.
fn sigma_of(own: f32, roughness: f32, step: f32) -> f32 {
    let rough = (BY_ROUGHNESS[0] + BY_ROUGHNESS[1] * roughness) * roughness;
    let mixed = if step.abs() <= SAME_SURFACE { BETWEEN_SURFACES * step } else { 0.0 };
    (own * own + rough * rough + INTERPOLATION * INTERPOLATION + mixed * mixed).sqrt()
}

/// The disparities of which nothing is wrong; NaN elsewhere.
fn trusted(disparities: &[f32], doubt: &[Option<Gap>]) -> Vec<f32> {
    let trusted = disparities.par_iter().zip(doubt);
    trusted.map(|(disparity, doubt)| if doubt.is_none() { *disparity } else { f32::NAN }).collect()
}

/// The disparities of the surface, shifted where registration converged.
fn moved(surface: &Surface, registration: &Registration) -> Vec<f32> {
    let moved = |(&disparity, &shift): (&f32, &f32)| if shift.abs() <= MOST { disparity + shift } else { disparity };
    surface.disparity.iter().zip(&registration.shift).map(moved).collect()
}
