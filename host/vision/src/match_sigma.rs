//! How far the pixels of a match may be off: along the epipolar curve and across it.

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

use crate::{Angle, Left, Right, StereoPair, UnitRay};

/// Standard deviations of the pixels of a match; each holds for both images.
///
/// An error along the epipolar curve makes the range uncertain, one across it the agreement with the pose. A single
/// number (`f64`) stands for both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchSigma {
    /// Along the epipolar curve, in pixels.
    pub along: f64,
    /// At right angles to the curve in the image, in pixels.
    pub across: f64,
}

impl From<f64> for MatchSigma {
    fn from(pixels: f64) -> Self {
        Self { along: pixels, across: pixels }
    }
}

impl MatchSigma {
    /// The standard deviations of pixels by which the parallax of both rays has the standard deviation `turns[0]`, and
    /// the angle between their epipolar planes, seen from the cameras, `turns[1]`; both images share the errors.
    ///
    /// `None` where a ray lies along the baseline.
    #[must_use]
    pub fn of_turns(
        turns: [Angle; 2],
        left: &UnitRay<Left>,
        right: &UnitRay<Right>,
        pair: &StereoPair<'_>,
    ) -> Option<Self> {
        let baseline = pair.left_from_right.origin().direction()?.vector();
        let in_right = pair.left_from_right.rotation().inverse() * baseline;
        let curves = [
            Curve::of(&pair.left.ray_by_pixel(left), &left.vector(), &baseline)?,
            Curve::of(&pair.right.ray_by_pixel(right), &right.vector(), &in_right)?,
        ];
        let sum = |of: fn(&Curve) -> f64| of(&curves[0]).powi(2) + of(&curves[1]).powi(2);
        let [along, across] = turns.map(|turn| turn.rad().powi(2));
        let across = across / sum(|curve| curve.turns[1]);
        // Where the lens stretches the image, a pixel at right angles to the curve turns the ray in its plane too.
        let along = (along - across * sum(|curve| curve.skew)).max(0.25 * along) / sum(|curve| curve.turns[0]);
        Some(Self { along: along.sqrt(), across: across.sqrt() })
    }

    /// The root mean square of both, in pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.along.hypot(self.across) * std::f64::consts::FRAC_1_SQRT_2
    }

    /// A matrix S whose S Sᵀ is the covariance of a unit ray, in rad²: `ray_by_pixel` is its derivative by its pixel,
    /// and `baseline` the direction between the cameras, all in the camera's frame.
    pub(crate) fn of_ray(
        &self,
        ray_by_pixel: &Matrix3x2<f64>,
        ray: &Vector3<f64>,
        baseline: &Vector3<f64>,
    ) -> Matrix3x2<f64> {
        let unequal = self.along.to_bits() != self.across.to_bits();
        match Curve::of(ray_by_pixel, ray, baseline).filter(|_| unequal) {
            Some(Curve { image, .. }) => {
                let [d, p] = image;
                ray_by_pixel * Matrix2::from_columns(&[d * self.along, p * self.across])
            }
            None => ray_by_pixel * self.mean(),
        }
    }
}

/// The epipolar curve of an image at a pixel.
struct Curve {
    /// Its direction, and the one at right angles to it.
    image: [Vector2<f64>; 2],
    /// Turn of the ray in the epipolar plane by a pixel along the curve, and across the plane by a pixel at right
    /// angles to it, in radians.
    turns: [f64; 2],
    /// Turn of the ray in the epipolar plane by a pixel at right angles to the curve.
    skew: f64,
}

impl Curve {
    fn of(ray_by_pixel: &Matrix3x2<f64>, ray: &Vector3<f64>, baseline: &Vector3<f64>) -> Option<Self> {
        // Below this sine to the baseline the epipolar plane counts as unknown.
        const VANISHING: f64 = 1e-9;
        let normal = baseline.cross(ray).try_normalize(VANISHING)?;
        let in_plane = normal.cross(ray);
        let inverse = (ray_by_pixel.transpose() * ray_by_pixel).try_inverse()?;
        let along = (inverse * ray_by_pixel.transpose() * in_plane).try_normalize(0.0)?;
        let across = Vector2::new(-along.y, along.x);
        let (turned, crossed) = (ray_by_pixel * along, ray_by_pixel * across);
        Some(Self {
            image: [along, across],
            turns: [in_plane.dot(&turned), normal.dot(&crossed)],
            skew: in_plane.dot(&crossed),
        })
    }
}

#[cfg(test)]
#[path = "../tests/unit/match_sigma.rs"]
mod tests;
