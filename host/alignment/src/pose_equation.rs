//! What one match says of the relative pose, to first order.

use nalgebra::{SVector, UnitQuaternion, Vector3, Vector6};

use crate::residual_spread::Place;
use vergence_vision::{
    LENS_PARAMETERS, Left, MatchSigma, PixelPair, ResidualUncertainty, Right, StereoPair, Transform, ray_to_plane,
};

/// Parameters of both lenses.
pub const LENSES: usize = 2 * LENS_PARAMETERS;
/// Residuals beyond this many standard deviations count as wrong matches.
pub const SCALE_SIGMAS: f64 = 2.5;

/// Applies a correction to a pose: R ← exp(ω) R, t ← t + δ.
pub fn moved(pose: &Transform<Left, Right>, by: &Vector6<f64>) -> Transform<Left, Right> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(by[0], by[1], by[2]));
    Transform::new(turn * pose.rotation(), pose.origin().mm() + by.fixed_rows::<3>(3))
}

/// The correction with which [`moved`] makes `to` of `from`.
#[must_use]
pub fn difference(to: &Transform<Left, Right>, from: &Transform<Left, Right>) -> Vector6<f64> {
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    let shift = to.origin().mm() - from.origin().mm();
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// The weight (1 + r²)⁻² of a residual r relative to its scale, of S. Geman and D. McClure (1987).
pub fn robust_weight(relative: f64) -> f64 {
    (1.0 + relative * relative).powi(-2)
}

/// One match's equation: offset + slope · correction = 0 with standard deviation `sigma`, in radians.
pub struct Equation {
    pub offset: f64,
    pub slope: Vector6<f64>,
    pub sigma: f64,
    /// Where the match lies in the left image.
    pub place: Place,
}

impl Equation {
    pub fn of(pixels: &PixelPair, sigma: MatchSigma, pair: &StereoPair<'_>) -> Option<Self> {
        Self::with_lenses(pixels, sigma, pair).map(|(equation, _)| equation)
    }

    /// The same, and the slope by the parameters of both lenses.
    pub fn with_lenses(
        pixels: &PixelPair,
        sigma: MatchSigma,
        pair: &StereoPair<'_>,
    ) -> Option<(Self, SVector<f64, LENSES>)> {
        let left = pair.left.unproject::<Left>(pixels.left).ok()?;
        let right = pair.right.unproject::<Right>(pixels.right).ok()?;
        let (StereoPair { left_from_right, .. }, _) = pair.at_origins(&left, &right);
        let offset = ray_to_plane(&left, &(left_from_right * right), &left_from_right.origin())?;
        let uncertainty = ResidualUncertainty::of(&left, &right, pair, sigma)?;
        let sigma = uncertainty.from_pixels.sqrt();
        let place = Place::of(pixels.left, pair.left.size().width);
        let equation = Self {
            offset: offset.rad(),
            slope: uncertainty.by_shared.fixed_columns::<6>(LENSES).transpose(),
            sigma,
            place,
        };
        (sigma > 0.0).then(|| (equation, uncertainty.by_shared.fixed_columns::<LENSES>(0).transpose()))
    }

    pub fn residual(&self, correction: &Vector6<f64>) -> f64 {
        self.offset + self.slope.dot(correction)
    }

    /// The weight 1/σ² times that of the residual over `scale`.
    pub fn weight(&self, correction: &Vector6<f64>, scale: f64) -> f64 {
        robust_weight(self.residual(correction) / scale) / (self.sigma * self.sigma)
    }

    pub fn agrees(&self, correction: &Vector6<f64>) -> bool {
        self.residual(correction).abs() <= 3.0 * self.sigma
    }

    /// 1/σ² for a match that agrees, else zero.
    pub fn full_weight(&self, correction: &Vector6<f64>) -> f64 {
        if self.agrees(correction) { (self.sigma * self.sigma).recip() } else { 0.0 }
    }
}
