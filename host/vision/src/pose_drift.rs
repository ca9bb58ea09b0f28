//! Whether the pose is what the picture says it is.
//!
//! An error of the relative pose turns all epipolar planes together: the angle of each pair of rays to one epipolar plane
//! changes to first order with a turn ω of the right camera and a shift δ of its centre. The turn and shift that explain most
//! of the angles follow by iteratively reweighted least squares (P. Holland and R. Welsch, Commun. Stat. A6, 1977) with the
//! weights of S. Geman and D. McClure (1987), their scale shrinking from that of a gross error to that of the measurement.
//!
//! The equations are written anew at the pose found, because to first order a turn of 5° would be wrong by 0.2°.
//!
//! Nothing is corrected here. Whoever measures is told.

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::epipolar::ray_to_plane;
use crate::uncertainty::ResidualUncertainty;
use crate::{Angle, Left, PixelPair, Right, StereoPair, Transform};

/// Fewer pairs say nothing.
const LEAST_PAIRS: usize = 20;
const ITERATIONS: usize = 30;
/// How often the equations are written anew.
const ROUNDS: usize = 3;
/// The scale of the first iterations, and the standard deviation of ω and of the baseline's direction without any pairs: so
/// far off a picture still has matches.
const GROSS: Angle = Angle::from_deg(3.0);
/// Residuals beyond this many standard deviations belong to wrong pairs.
const SCALE_SIGMAS: f64 = 2.5;
/// χ² of five unknowns exceeded by one in ten thousand: the shift along the baseline cannot be seen.
const SIGNIFICANT: f64 = 25.7;

/// What the pairs say of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDrift {
    /// The turn that the picture asks for, about the left axes in radians, and the shift of the right camera in the left frame
    /// in millimetres.
    pub correction: Vector6<f64>,
    /// The covariance of `correction` from the pairs.
    pub covariance: Matrix6<f64>,
    /// The angle of the turn.
    pub angle: Angle,
    /// How unlikely the correction is for a pose as well known as stated: χ² of five unknowns.
    pub chi_squared: f64,
    /// The share of pairs that agree with the corrected pose.
    pub agreeing: f64,
}

impl PoseDrift {
    /// Whether the pose is off by more than it is said to be.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.chi_squared > SIGNIFICANT
    }
}

/// Compares the pose of `pair` with what `pixels` say, most of them right to the standard deviation in pixels that stands with
/// each. `pose` is the stated covariance of the pose, in the coordinates of [`crate::SharedCovariance`]. `None` with fewer
/// than 20 usable pairs.
#[must_use]
pub fn pose_drift(pixels: &[(PixelPair, f64)], pair: &StereoPair<'_>, pose: &Matrix6<f64>) -> Option<PoseDrift> {
    let prior = weak_prior(pair.left_from_right.origin().mm().norm());
    let (mut found, mut correction, mut covariance) = (*pair, Vector6::zeros(), Matrix6::zeros());
    let mut agreeing = 0.0;
    for round in 0..ROUNDS {
        let equations: Vec<Equation> = pixels.iter().filter_map(|pixels| Equation::of(pixels, &found)).collect();
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

/// R ← exp(ω) R, t ← t + δ.
fn moved(pose: &Transform<Left, Right>, by: &Vector6<f64>) -> Transform<Left, Right> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(by[0], by[1], by[2]));
    Transform::new(turn * pose.rotation(), pose.origin().mm() + by.fixed_rows::<3>(3))
}

/// What [`moved`] needs to make `to` of `from`.
fn difference(to: &Transform<Left, Right>, from: &Transform<Left, Right>) -> Vector6<f64> {
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    let shift = to.origin().mm() - from.origin().mm();
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// Information without any pairs, which fixes what they do not: the shift along the baseline.
fn weak_prior(baseline_mm: f64) -> Matrix6<f64> {
    let (turn, shift) = (GROSS.rad().powi(-2), (GROSS.rad() * baseline_mm).powi(-2));
    Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift))
}

/// offset + slope · correction = 0 for a right pair, to `sigma`.
struct Equation {
    offset: f64,
    slope: Vector6<f64>,
    sigma: f64,
}

impl Equation {
    fn of((pixels, pixel_sigma): &(PixelPair, f64), pair: &StereoPair<'_>) -> Option<Self> {
        let left = pair.left.unproject::<Left>(pixels.left).ok()?;
        let right = pair.right.unproject::<Right>(pixels.right).ok()?;
        let offset = ray_to_plane(&left, &(pair.left_from_right * right), &pair.left_from_right.origin())?;
        let uncertainty = ResidualUncertainty::of(&left, &right, pair, *pixel_sigma)?;
        let sigma = uncertainty.from_pixels.sqrt();
        (sigma > 0.0).then(|| Self { offset: offset.rad(), slope: uncertainty.by_pose(), sigma })
    }

    fn residual(&self, correction: &Vector6<f64>) -> f64 {
        self.offset + self.slope.dot(correction)
    }

    /// 1/σ² times (1 + (residual / scale)²)⁻².
    fn weight(&self, correction: &Vector6<f64>, scale: f64) -> f64 {
        let relative = self.residual(correction) / scale;
        (1.0 + relative * relative).powi(-2) / (self.sigma * self.sigma)
    }

    fn agrees(&self, correction: &Vector6<f64>) -> bool {
        self.residual(correction).abs() <= 3.0 * self.sigma
    }
}
