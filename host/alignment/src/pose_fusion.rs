//! The relative pose from the joints and from the matches of one pair of images together.
//!
//! Where the joints hardly tell the pose, as at a dead centre of a linkage or with a dead encoder, the matches do: the most
//! probable pose minimises
//!
//! ```text
//! cᵀ P⁻¹ c  +  Σ (residual of a match off its epipolar plane / σ)²
//! ```
//!
//! over the correction c of the stated pose, whose covariance P is that of the joints. Matches tell nothing of the length of the
//! baseline, so that the joints always tell that. Wrong matches are faded out as in [`crate::pose_drift`]; at the end those beyond
//! three standard deviations are left out and all others weigh fully, so that the covariance is that of least squares. There the
//! variance of all matches is that of their residuals, as [`crate::residual_spread`] finds it, in place of the one that is stated, and
//! what matches have in common is added.
//!
//! How much each source told is counted by the degrees of freedom for signal (C. Rodgers, *Inverse Methods for Atmospheric
//! Sounding*, 2000, eq. 2.56): of the six components of the pose the images told tr(1 - C P⁻¹), with C the covariance found.

use nalgebra::{Matrix6, SymmetricEigen, Vector6};

use crate::pose_equation::{Equation, SCALE_SIGMAS, difference, moved};
use crate::residual_spread::{shared_covariance, variance_factor};
use vergence_vision::{Angle, Left, MatchSigma, PixelPair, Right, StereoPair, Transform};

/// Smallest number of matches that agree with the pose found.
const LEAST_PAIRS: usize = 20;
const ITERATIONS: usize = 30;
/// Iterations with the scale of the measurement at the end of each fading.
const SETTLING: usize = 8;
/// Number of times the equations are linearised again. Before the last one the errors of the matches are measured.
const ROUNDS: usize = 6;
/// Least scale of the first iterations, in radians: 3 degrees.
const GROSS: f64 = 0.0524;

/// A relative pose from joints and images together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusedPose {
    /// The most probable pose of the right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// Its covariance, in the coordinates of the pose in [`vergence_vision::SharedCovariance`].
    pub covariance: Matrix6<f64>,
    /// The way from the pose by the joints: a turn in radians, then a shift in millimetres.
    pub correction: Vector6<f64>,
    /// How many of the six components of the pose the images told; the joints told the rest. Matches alone tell five.
    pub told_by_images: f64,
    /// The fraction of matches that agree with the pose.
    pub agreeing: f64,
    /// Variance of what the matches say together, over the one that their standard deviations state.
    pub variance_factor: f64,
}

/// The standard deviations of matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatchErrors {
    /// They are measured: all are scaled by one factor to what the residuals of the matches show.
    Measured,
    /// They hold as they are stated: the matches are exact, and only what they would tell is asked for.
    Stated,
}

impl FusedPose {
    /// How many of the six components of the pose the joints told.
    #[must_use]
    pub fn told_by_joints(&self) -> f64 {
        6.0 - self.told_by_images
    }

    /// The way from this pose to another, in the coordinates of `covariance`.
    #[must_use]
    pub fn way_to(&self, to: &Transform<Left, Right>) -> Vector6<f64> {
        difference(to, &self.left_from_right)
    }

    /// Standard deviation of the rotation: the root of the sum of squares over three axes.
    #[must_use]
    pub fn rotation_sigma(&self) -> Angle {
        Angle::from_rad(self.covariance.fixed_view::<3, 3>(0, 0).trace().max(0.0).sqrt())
    }
}

/// The most probable pose of `pair`, whose stated pose has the covariance `joints`, given matches with their standard deviations
/// in pixels (one number, or [`MatchSigma`]); some may be wrong. `errors` says whether these deviations hold.
///
/// `None` where fewer than 20 matches agree on one pose.
#[must_use]
pub fn fuse_pose<S: Copy + Into<MatchSigma>>(
    pixels: &[(PixelPair, S)],
    pair: &StereoPair<'_>,
    joints: &Matrix6<f64>,
    errors: MatchErrors,
) -> Option<FusedPose> {
    let spread = root(joints);
    let gross = joints.fixed_view::<3, 3>(0, 0).trace().max(0.0).sqrt().max(GROSS);
    let mut fused = FusedPose {
        left_from_right: pair.left_from_right,
        covariance: *joints,
        correction: Vector6::zeros(),
        told_by_images: 0.0,
        agreeing: 0.0,
        variance_factor: 1.0,
    };
    for round in 0..ROUNDS {
        let found = StereoPair { left_from_right: fused.left_from_right, ..*pair };
        let equations: Vec<Equation> =
            pixels.iter().filter_map(|(pixels, sigma)| Equation::of(pixels, (*sigma).into(), &found)).collect();
        let mut step = Vector6::zeros();
        let mut left = Matrix6::identity();
        for iteration in 0..ITERATIONS {
            let fade =
                if round == 0 { (1.0 - iteration as f64 / (ITERATIONS - SETTLING) as f64).max(0.0) } else { 0.0 };
            let weight = |equation: &Equation| {
                let scale = (SCALE_SIGMAS * equation.sigma).max(gross * fade * fade);
                match round + 2 < ROUNDS {
                    true => equation.weight(&step, scale),
                    false => equation.full_weight(&step) / fused.variance_factor,
                }
            };
            let posterior = Posterior::of(&equations, weight, &spread, &fused.correction)?;
            step = posterior.correction - fused.correction;
            fused.covariance = posterior.covariance;
            left = posterior.left;
        }
        fused.told_by_images = 6.0 - left.trace();
        if round + 2 == ROUNDS && errors == MatchErrors::Measured {
            fused.variance_factor = variance_factor(&equations, &step, &spread, &left, fused.told_by_images);
        }
        if round + 1 == ROUNDS && errors == MatchErrors::Measured {
            let scale = (fused.variance_factor, pair.left.k()[0]);
            let shared = shared_covariance(&equations, &step, &spread, &left, scale);
            fused.covariance += spread * shared * spread.transpose();
        }
        let agreeing = equations.iter().filter(|equation| equation.agrees(&step)).count();
        if agreeing < LEAST_PAIRS {
            return None;
        }
        fused.agreeing = agreeing as f64 / equations.len() as f64;
        fused.left_from_right = moved(&found.left_from_right, &step);
        fused.correction = difference(&fused.left_from_right, &pair.left_from_right);
    }
    Some(fused)
}

/// The most probable correction by weighted equations and the prior.
struct Posterior {
    correction: Vector6<f64>,
    covariance: Matrix6<f64>,
    /// What is left of the prior, in the coordinates in which that is the identity.
    left: Matrix6<f64>,
}

impl Posterior {
    /// Solves in the coordinates z of c = S z with S Sᵀ the prior, in which the prior is the identity: a component that the joints
    /// tell exactly stays as it is. The equations are linear around the correction `at`.
    fn of(
        equations: &[Equation],
        weight: impl Fn(&Equation) -> f64,
        spread: &Matrix6<f64>,
        at: &Vector6<f64>,
    ) -> Option<Self> {
        let (mut normal, mut right_side) = (Matrix6::identity(), Vector6::zeros());
        for equation in equations {
            let (slope, weight) = (spread.transpose() * equation.slope, weight(equation));
            normal += slope * slope.transpose() * weight;
            right_side += slope * (weight * (equation.slope.dot(at) - equation.offset));
        }
        let factor = normal.cholesky()?;
        let left = factor.inverse();
        let covariance = spread * left * spread.transpose();
        Some(Self { correction: spread * factor.solve(&right_side), covariance, left })
    }
}

/// A matrix S with S Sᵀ = `covariance`, which may be singular.
fn root(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    // Turns in radians and shifts in millimetres differ by orders of magnitude: the eigenvalues are those of the correlation.
    let sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let scale = sigmas.map(|sigma| if sigma > 0.0 { sigma.recip() } else { 0.0 });
    let correlation = Matrix6::from_diagonal(&scale) * covariance * Matrix6::from_diagonal(&scale);
    let eigen = SymmetricEigen::new((correlation + correlation.transpose()) / 2.0);
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    Matrix6::from_diagonal(&sigmas) * eigen.eigenvectors * Matrix6::from_diagonal(&roots)
}
