//! What is known of a lens and a target before any view: how far the parameters that a lens has besides those of a central and symmetric one are
//! from zero, and the bow of the target.
//!
//! They are adjusted with this prior, so that what few views do not tell of them stays unknown within what lenses have, and makes the
//! covariance as large as that ignorance is. Without it a lens that is not of the model's family borrows a pupil of centimetres from views
//! that hardly determine one.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::adjust::{Adjusted, median_of_used};
use super::lens::{E0, E1, K6, LENS};
use super::observations::ObservedView;

/// A sum of parameters with weights, the first of them 1, that is zero within a standard deviation.
pub(super) struct Known {
    pub sum: &'static [(usize, f64)],
    pub sigma: f64,
}

/// All that is known, each independent of the others.
pub(super) const KNOWN: [Known; 12] = [
    // e0 in millimetres: twice the focal length of common lenses.
    Known { sum: &[(E0, 1.0)], sigma: 3.0 },
    // e1 in millimetres: the traced designs have 0.06 and 0.36 (sigma8_f18, nikkor6_f28).
    Known { sum: &[(E1, 1.0)], sigma: 0.5 },
    Known { sum: &[(P1, 1.0)], sigma: P },
    Known { sum: &[(P2, 1.0)], sigma: P },
    Known { sum: &[(S0, 1.0), (P1, SQUARE_BY_P)], sigma: SQUARE },
    Known { sum: &[(S2, 1.0), (P2, SQUARE_BY_P)], sigma: SQUARE },
    Known { sum: &[(S1, 1.0), (P1, FOURTH_BY_P), (S0, FOURTH_BY_SQUARE)], sigma: FOURTH },
    Known { sum: &[(S3, 1.0), (P2, FOURTH_BY_P), (S2, FOURTH_BY_SQUARE)], sigma: FOURTH },
    Known { sum: &[(P3, 1.0), (P1, GROWTH_BY_P), (S0, GROWTH_BY_SQUARE), (S1, GROWTH_BY_FOURTH)], sigma: GROWTH },
    Known { sum: &[(P4, 1.0), (P2, GROWTH_BY_P), (S2, GROWTH_BY_SQUARE), (S3, GROWTH_BY_FOURTH)], sigma: GROWTH },
    // The bow of the target in millimetres, as boards of paper have.
    Known { sum: &[(BOW, 1.0)], sigma: 1.0 },
    Known { sum: &[(BOW + 1, 1.0)], sigma: 1.0 },
];
/// Which of them are of decentring and thin prism.
const ASYMMETRY: Range<usize> = 2..10;

// Indices of the parameters, in the order of `LENS_PARAMETERS`.
const P1: usize = E1 + 1;
const P2: usize = E1 + 2;
const S0: usize = E1 + 3;
const S1: usize = E1 + 4;
const S2: usize = E1 + 5;
const S3: usize = E1 + 6;
const P3: usize = K6 + 1;
const P4: usize = K6 + 2;
/// The first of the two parameters of the target.
pub(super) const BOW: usize = LENS;

// Decentring and thin prism of badly mounted lenses, which go together: `sigma8_f18` traced with every element 10 micrometres off the axis and
// tilted by 0.05 degrees, and a sensor tilted by 0.4 degrees, has standard deviations of 6e-4 of p1 and p2, 1.2e-3 of s0 and s2, 3.2e-4 of s1 and
// s3, and 1.9e-4 of p3 and p4 (docs/measured/lenses.md). Below, each beside what those before it let expect.
const P: f64 = 7e-4;
const SQUARE: f64 = 8.4e-4;
const SQUARE_BY_P: f64 = 1.5;
const FOURTH: f64 = 1.7e-4;
const FOURTH_BY_P: f64 = -0.38;
const FOURTH_BY_SQUARE: f64 = -0.32;
const GROWTH: f64 = 4.5e-5;
const GROWTH_BY_P: f64 = -0.073;
const GROWTH_BY_SQUARE: f64 = -0.027;
const GROWTH_BY_FOURTH: f64 = 0.60;

/// By how much the views narrow what was known of decentring and thin prism, in the direction of them of which they say least: the standard
/// deviation that is left, in parts of that before, where the variance of a residual is `variance`. `None` where that is not known.
pub(super) fn narrowest(adjusted: &Adjusted, variance: f64) -> Option<f64> {
    let (_, left) = asymmetry(adjusted, variance)?;
    Some(SymmetricEigen::new(left).eigenvalues.max().max(0.0).sqrt())
}

/// The decentring and thin prism of a lens and their covariance, in standard deviations of what is known before any view, for `variance`, that of
/// a residual. `None` where they are not adjusted or not determined.
pub(super) fn asymmetry(adjusted: &Adjusted, variance: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let covariance = adjusted.normal.shared_covariance()?;
    let known = KNOWN.get(ASYMMETRY)?;
    let mut by_free = DMatrix::zeros(known.len(), adjusted.free.len());
    for (row, Known { sum, sigma }) in known.iter().enumerate() {
        for (parameter, weight) in *sum {
            by_free[(row, adjusted.free.iter().position(|free| free == parameter)?)] = weight / sigma;
        }
    }
    let lens = adjusted.shared.lens.to_array();
    let values = adjusted.free.iter().map(|&parameter| lens.get(parameter).copied().unwrap_or_default());
    let values = DVector::from_iterator(adjusted.free.len(), values);
    Some((&by_free * values, &by_free * covariance * by_free.transpose() * variance))
}

/// How the prior weighs against the views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    /// How much more the views pull than the noise of their corners explains, see [`crate::schur_lm::Clustered::scatter`]. A view weighs
    /// less against the prior by that.
    pub scatter: f64,
    /// How badly the lens is mounted, in parts of the badly mounted ones: see [`super::mounting`].
    pub mounting: f64,
}

/// The prior in units of residuals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strength {
    /// Of what is known to one standard deviation.
    of_one: f64,
    mounting: f64,
}

impl Strength {
    /// That of `prior`, where this one is of a prior with scatter 1.
    pub fn scaled(self, prior: Prior) -> Self {
        Self { of_one: self.of_one * prior.scatter, ..self.mounted(prior) }
    }

    /// With the mounting of `prior`.
    pub fn mounted(self, prior: Prior) -> Self {
        Self { mounting: prior.mounting, ..self }
    }

    /// By what to multiply the deviation from the `nth` of [`KNOWN`], in its standard deviations.
    pub fn of(self, nth: usize) -> f64 {
        if ASYMMETRY.contains(&nth) { self.of_one / self.mounting } else { self.of_one }
    }
}

impl Prior {
    /// Variance by which the prior is weighted, over that of the residuals.
    pub fn factor(self) -> f64 {
        self.scatter * self.scatter
    }

    /// The prior in units of residuals, which weigh by their scale.
    /// `deviations` are those of all corners.
    pub fn strength(self, views: &[ObservedView], deviations: &[f64]) -> Option<Strength> {
        Some(Strength { of_one: self.scatter * noise(views, deviations)?, mounting: self.mounting })
    }
}

/// Least scale of noise: below it residuals are rounding errors, in pixels.
pub(super) const FINEST: f64 = 1e-4;

/// Standard deviation of a coordinate over the corners used, in units of their relative sigmas: the median length of a two-dimensional
/// Gaussian error is 1.18 of it.
fn noise(views: &[ObservedView], deviations: &[f64]) -> Option<f64> {
    const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_474_7;
    Some(median_of_used(views, deviations)?.max(FINEST) / RAYLEIGH_MEDIAN)
}
