//! Refinement of whole disparities to fractions of a pixel, with their standard deviation, and what is wrong with them.

use rayon::prelude::*;

use super::Gap;
use super::edges::steps;
use super::register::{Registration, SampledView};
use super::support::isolated;
use super::surface::{SAME_SURFACE, Surface};
use crate::pool::give_back;

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

impl Drop for Disparities {
    fn drop(&mut self) {
        let Self { disparity, sigma, likeness, other, .. } = self;
        [disparity, sigma, likeness, other].into_iter().for_each(|values| give_back(std::mem::take(values)));
    }
}

/// Smooths and registers twice. The first pass brings slanted surfaces within the reach of the second. `area` is that of
/// a pixel of the coarsest level of the search.
pub(super) fn registered(views: [SampledView<'_>; 2], whole: Vec<f32>, area: usize) -> Disparities {
    let (width, count) = (views[0].plane.width(), whole.len());
    let (mut smooth, mut registration) = (Surface::new(count), Registration::new(count));
    smooth.fit(&whole, width, REACH);
    registration.run(views, &smooth.disparity, REACH);
    let mut disparity = whole;
    moved(&mut disparity, &smooth, &registration);
    smooth.fit(&disparity, width, REACH);
    registration.run(views, &smooth.disparity, REACH);
    moved(&mut disparity, &smooth, &registration);
    let Surface { disparity: mut trusted, roughness } = smooth;
    let Registration { sigma: own, likeness, shift: mut other } = registration;
    let mut doubt: Vec<Option<Gap>> = own.par_iter().zip(&likeness).map(by_window).collect();
    trusted.par_iter_mut().zip(&disparity).zip(&doubt).for_each(|((trusted, disparity), doubt)| {
        *trusted = if doubt.is_none() { *disparity } else { f32::NAN };
    });
    let small = isolated(&trusted, width, (SMALLEST * area) as u32);
    doubt
        .par_iter_mut()
        .zip(&mut trusted)
        .zip(&small)
        .filter(|((doubt, _), small)| doubt.is_none() && **small)
        .for_each(|((doubt, trusted), _)| {
            (*doubt, *trusted) = (Some(Gap::Isolated), f32::NAN);
        });
    let steps = steps(&trusted, views[0].seen, width);
    other.par_iter_mut().zip(&disparity).zip(&steps).for_each(|((other, own), step)| {
        *other = if step.abs() > SAME_SURFACE { own + step } else { f32::NAN };
    });
    let mut sigma = own;
    sigma.par_iter_mut().zip(&roughness).zip(&steps).for_each(|((sigma, roughness), step)| {
        *sigma = sigma_of(*sigma, *roughness, *step);
    });
    [trusted, roughness, steps].into_iter().for_each(give_back);
    Disparities { disparity, sigma, likeness, other, doubt }
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

/// The disparities of the surface, shifted where registration converged.
fn moved(disparity: &mut [f32], surface: &Surface, registration: &Registration) {
    let from = disparity.par_iter_mut().zip(&surface.disparity).zip(&registration.shift);
    from.for_each(|((moved, &disparity), &shift)| {
        *moved = if shift.abs() <= MOST { disparity + shift } else { disparity };
    });
}
