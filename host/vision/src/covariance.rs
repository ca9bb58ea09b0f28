//! The covariance of a pseudo-intersected point in closed form.
//!
//! With isotropic, independent angular noise σ on both rays, t the right centre, λ = |P|, μ = |P - t|, to first order
//!
//! ```text
//! C = σ² / |t × P|² · [λ⁴ (P - t)(P - t)ᵀ + μ⁴ P Pᵀ]  +  σ² (λ² + μ²) / 4 · n nᵀ        n = (t × P) / |t × P|
//! ```
//!
//! In the epipolar plane, a turn of the left ray moves the point along the right ray, and a turn of the right ray moves
//! it along the left ray. Across the plane, the pseudo-intersection averages both rays.

use nalgebra::Matrix3;

use crate::{Angle, Left, Length, Point};

/// The covariance of a pseudo-intersected `point` in mm², in the left frame, for isotropic angular noise of standard
/// deviation `sigma` on both rays.
///
/// `None` for a point on the line through both centres, and where an argument is not finite.
#[must_use]
pub fn covariance(point: &Point<Left>, right_centre: &Point<Left>, sigma: Angle) -> Option<Matrix3<f64>> {
    // Below this sine to the baseline the covariance counts as unbounded.
    const ALONG_BASELINE: f64 = 1e-9;
    let (p, t) = (point.mm(), right_centre.mm());
    let from_right = p - t;
    let normal = t.cross(&p);
    let (left_squared, right_squared, area_squared) =
        (p.norm_squared(), from_right.norm_squared(), normal.norm_squared());
    if area_squared <= ALONG_BASELINE * ALONG_BASELINE * left_squared * t.norm_squared() {
        return None;
    }
    let in_plane = left_squared * left_squared * from_right * from_right.transpose()
        + right_squared * right_squared * p * p.transpose();
    let across = (left_squared + right_squared) / 4.0 * normal * normal.transpose();
    let covariance = (in_plane + across) * (sigma.rad() * sigma.rad() / area_squared);
    covariance.iter().all(|c| c.is_finite()).then_some(covariance)
}

/// The standard deviation of the distance of `point` from the left optical centre, from its covariance in mm².
/// `None` at the optical centre itself.
#[must_use]
pub fn range_sigma(covariance: &Matrix3<f64>, point: &Point<Left>) -> Option<Length> {
    let along = point.direction()?.vector();
    Some(Length::from_mm((along.transpose() * covariance * along).x.max(0.0).sqrt()))
}
