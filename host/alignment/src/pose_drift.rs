//! A test of the stated relative pose against the matches of one pair of images.
//!
//! An error of the relative pose turns all epipolar planes together: the angle of each pair of rays to one epipolar
//! plane changes to first order with a turn ω of the right camera and a shift δ of its centre. The turn and shift that
//! explain most of the angles follow by iteratively reweighted least squares (P. Holland and R. Welsch, Commun. Stat.
//! A6, 1977) with the weights of S. Geman and D. McClure (1987), their scale shrinking from that of a gross error to
//! that of the measurement.
//!
//! The equations are linearised again at each pose found, because to first order a turn of 5° would be wrong by 0.2°.
//!
//! The pose is not corrected here: the result only says how far it is off.

use nalgebra::{Matrix6, Vector6};

use crate::pose_equation::{Equation, SCALE_SIGMAS, difference, moved};
use vergence_vision::{Angle, MatchSigma, PixelPair, StereoPair};

/// Smallest number of usable matches.
const LEAST_PAIRS: usize = 20;
const ITERATIONS: usize = 30;
/// Number of times the equations are linearised again.
const ROUNDS: usize = 3;
/// Scale of the first iterations, and prior standard deviation of ω and of the baseline's direction: images still match
/// with a pose that is off by this much.
const GROSS: Angle = Angle::from_deg(3.0);
/// χ² of five unknowns with a probability of 1e-4. The sixth, the shift along the baseline, has no effect on the
/// angles.
const SIGNIFICANT: f64 = 25.7;

/// The error of the stated relative pose, as estimated from matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDrift {
    /// The correction that the matches suggest: a turn about the left axes in radians, then a shift of the right camera
    /// in the left frame in millimetres.
    pub correction: Vector6<f64>,
    /// The covariance of `correction` from the matches.
    pub covariance: Matrix6<f64>,
    /// The angle of the turn in `correction`.
    pub angle: Angle,
    /// χ² of the correction with five degrees of freedom, by the stated covariance of the pose and that of the
    /// correction.
    pub chi_squared: f64,
    /// The fraction of matches that agree with the corrected pose.
    pub agreeing: f64,
}

impl PoseDrift {
    /// Whether the pose is off by more than its stated covariance explains, at a significance of 1e-4.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.chi_squared > SIGNIFICANT
    }
}

/// Compares the pose of `pair` with matches, each given with its standard deviations in pixels (one number, or [`MatchSigma`]); some may be wrong.
///
/// `pose` is the stated covariance of the pose, in the coordinates of [`vergence_vision::SharedCovariance`]. Returns `None` with
/// fewer than 20 usable matches.
#[must_use]
pub fn pose_drift<S: Copy + Into<MatchSigma>>(
    pixels: &[(PixelPair, S)],
    pair: &StereoPair<'_>,
    pose: &Matrix6<f64>,
) -> Option<PoseDrift> {
    let prior = weak_prior(pair.left_from_right.origin().mm().norm());
    let (mut found, mut correction, mut covariance) = (*pair, Vector6::zeros(), Matrix6::zeros());
    let mut agreeing = 0.0;
    for round in 0..ROUNDS {
        let equations: Vec<Equation> =
            pixels.iter().filter_map(|(pixels, sigma)| Equation::of(pixels, (*sigma).into(), &found)).collect();
        if equations.len() < LEAST_PAIRS {
            return None;
        }
        let mut step = Vector6::zeros();
        for iteration in 0..ITERATIONS {
            let fade = if round == 0 { (1.0 - iteration as f64 / (ITERATIONS - 8) as f64).max(0.0) } else { 0.0 };
            let (mut normal, mut right_side) = (prior, -prior * correction);
            for equation in &equations {
                let scale = (SCALE_SIGMAS * equation.sigma).max(GROSS.rad() * fade * fade);
                let weight = equation.weight(&step, scale);
                normal += equation.slope * equation.slope.transpose() * weight;
                right_side -= equation.slope * (weight * equation.offset);
            }
            let factor = normal.cholesky()?;
            step = factor.solve(&right_side);
            covariance = factor.inverse();
        }
        agreeing = equations.iter().filter(|equation| equation.agrees(&step)).count() as f64 / equations.len() as f64;
        found.left_from_right = moved(&found.left_from_right, &step);
        correction = difference(&found.left_from_right, &pair.left_from_right);
    }
    let chi_squared = correction.dot(&(covariance + pose).cholesky()?.solve(&correction));
    let angle = Angle::from_rad(correction.fixed_rows::<3>(0).norm());
    Some(PoseDrift { correction, covariance, angle, chi_squared, agreeing })
}

/// Prior information, which fixes the shift along the baseline: matches cannot.
fn weak_prior(baseline_mm: f64) -> Matrix6<f64> {
    let (turn, shift) = (GROSS.rad().powi(-2), (GROSS.rad() * baseline_mm).powi(-2));
    Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift))
}
