//! What is known of a lens before any view: how far the parameters that a lens has besides those of a central and symmetric one are from zero.
//!
//! They are adjusted with this prior, so that what few views do not tell of them stays unknown within what lenses have, and makes the
//! covariance as large as that ignorance is. Without it a lens that is not of the model's family borrows a pupil of centimetres from views
//! that hardly determine one.

use vergence_vision::{LENS_PARAMETERS, median};

use super::adjust::State;
use super::lens::{E0, E1};
use super::observations::ObservedView;

/// Standard deviation of e0 in millimetres: twice the focal length of common lenses.
const E0_MM: f64 = 3.0;
/// Of e1 in millimetres: the traced designs have 0.06 and 0.36 (`sigma8_f18`, `nikkor6_f28`).
const E1_MM: f64 = 0.5;
/// Of p1 and p2, of s0 and s2, of s1 and s3: those of `sigma8_f18` traced with every element 10 micrometres off the axis and tilted by 0.05
/// degrees, and a sensor tilted by 0.4 degrees, which is a badly mounted lens (docs/measured/lenses.md).
const ASYMMETRY: [f64; 6] = [P, P, S_SQUARE, S_FOURTH, S_SQUARE, S_FOURTH];
const P: f64 = 7e-4;
const S_SQUARE: f64 = 1.4e-3;
const S_FOURTH: f64 = 7e-4;

/// How the prior weighs against the views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    /// How much more the views pull than the noise of their corners explains, see [`crate::schur_lm::Clustered::scatter`]. A view weighs
    /// less against the prior by that.
    pub scatter: f64,
}

/// The pull of every parameter of the lens towards zero, in units of residuals per unit of the parameter.
pub(super) type Pulls = [f64; LENS_PARAMETERS];

/// Standard deviation of a parameter before anything is known of the lens; `None` for one of a central and symmetric lens, of which nothing is.
pub(super) fn prior_sigma(parameter: usize) -> Option<f64> {
    match parameter {
        E0 => Some(E0_MM),
        E1 => Some(E1_MM),
        other => ASYMMETRY.get(other.checked_sub(E1 + 1)?).copied(),
    }
}

impl Prior {
    /// Variance by which the prior is weighted, over that of the residuals.
    pub fn factor(self) -> f64 {
        self.scatter * self.scatter
    }

    /// The pulls. Residuals weigh by their scale, so that the prior must be scaled too.
    pub fn pulls(self, views: &[ObservedView], state: &State) -> Option<Pulls> {
        let strength = self.scatter * noise(views, state)?;
        Some(std::array::from_fn(|parameter| prior_sigma(parameter).map_or(0.0, |sigma| strength / sigma)))
    }
}

/// Least scale of noise: below it residuals are rounding errors, in pixels.
pub(super) const FINEST: f64 = 1e-4;

/// Standard deviation of a coordinate over the corners used, in units of their relative sigmas: the median length of a two-dimensional
/// Gaussian error is 1.18 of it.
fn noise(views: &[ObservedView], state: &State) -> Option<f64> {
    const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_474_7;
    let used = views.iter().zip(&state.poses).flat_map(|(v, p)| v.used().map(|s| state.shared.deviation(p, s)));
    Some(median(used.collect())?.max(FINEST) / RAYLEIGH_MEDIAN)
}
