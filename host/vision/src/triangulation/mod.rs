//! A point from two rays: the pseudo-intersection, and others to compare with.
//!
//! With u, v the unit rays and t the right centre in the left frame, the feet of the common perpendicular are at
//!
//! ```text
//! λ = ((t × v) · (u × v)) / |u × v|²        μ = ((t × u) · (u × v)) / |u × v|²        S = (λ u + t + μ v) / 2
//! ```
//!
//! The midpoint S is short by δ² / (γ² + δ²) of the range, γ the parallax and δ the angle between the epipolar planes.
//! The pseudo-intersection S' takes from S only its epipolar plane, with normal n = (t × S) / |t × S|, and intersects
//! the rays projected onto that plane, with [a, b, c] the determinant:
//!
//! ```text
//! λ' = [t, v, n] / [u, v, n]        μ' = [t, u, n] / [u, v, n]        S' = λ' (u - (u·n) n)
//! ```
//!
//! To first order this plane halves the angle between the two epipolar planes, which puts S' in the family of
//! Lee and Civera, "Closed-form optimal two-view triangulation based on angular errors", ICCV 2019.

mod angular;
mod edge_plane;
mod kernel;
mod mid2;
mod rectified;
mod reprojection;

use nalgebra::Vector3;

pub use angular::{AngularNorm, angular};
pub use edge_plane::edge_plane;
pub use kernel::{Kernel, UnknownKernel};
pub use mid2::mid2;
pub use rectified::rectified;
pub use reprojection::reprojection;

use crate::epipolar::dihedral;
use crate::{Angle, Left, Length, Point, UnitRay};

/// Sines below this are taken as zero: a range of 10⁹ baselines, where rounding leaves about seven digits.
const VANISHING: f64 = 1e-9;

/// A point seen by both cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulated {
    /// The point in the left frame.
    pub point: Point<Left>,
    /// Its distance from the left optical centre.
    pub left_range: Length,
    /// Its distance from the right optical centre.
    pub right_range: Length,
    /// The angle between the epipolar planes of the two rays, not negative.
    pub skew: Angle,
    /// The angle that the baseline spans as seen from the point.
    pub parallax: Angle,
}

/// Why two rays make no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// The rays, or their projections onto the common epipolar plane, are parallel: the range is infinite.
    #[error("parallel rays")]
    Parallel,
    /// The point lies on the line through both centres (both rays near an epipole), the centres coincide, or they are
    /// not finite: there is no epipolar plane.
    #[error("on the baseline")]
    OnBaseline,
    /// The rays meet behind a camera.
    #[error("diverging rays")]
    Diverging,
    /// A ray does not meet the image plane of the rectified view, which holds less than 180°.
    #[error("outside the rectified view")]
    OutsideView,
    /// The reprojection error has no minimum near the rays.
    #[error("no minimum of the reprojection error")]
    NotConverged,
}

/// The pseudo-intersection S' of two rays.
///
/// `right` is the right camera's ray turned into the left frame; `right_centre` is the right optical centre.
///
/// # Errors
/// [`Rejection`] for rays that make no point.
pub fn pseudo_intersection(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Triangulated, Rejection> {
    let (u, v, t) = (left.vector(), right.vector(), right_centre.mm());
    let feet = closest_approach(left, right, right_centre)?;
    let n = plane_normal(&t, &feet.midpoint().mm())?;
    let point = in_plane(&u, &v, &t, &n)?;
    require(feet.in_front(), Rejection::Diverging)?;
    Ok(triangulated(point, left, right, right_centre))
}

/// Where the rays projected onto the epipolar plane with unit normal `n` meet.
fn in_plane(u: &Vector3<f64>, v: &Vector3<f64>, t: &Vector3<f64>, n: &Vector3<f64>) -> Result<Vector3<f64>, Rejection> {
    let determinant = u.cross(v).dot(n);
    require(determinant.abs() > VANISHING, Rejection::Parallel)?;
    let lambda = t.cross(v).dot(n) / determinant;
    let mu = t.cross(u).dot(n) / determinant;
    require(lambda > 0.0 && mu > 0.0, Rejection::Diverging)?;
    Ok(lambda * (u - n * u.dot(n)))
}

/// The midpoint S of the common perpendicular of two rays: the textbook method, biased towards the cameras where the
/// rays are skew. Arguments as for [`pseudo_intersection`].
///
/// # Errors
/// [`Rejection`] for rays that make no point.
pub fn midpoint(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Triangulated, Rejection> {
    let feet = closest_approach(left, right, right_centre)?;
    let point = feet.midpoint().mm();
    plane_normal(&right_centre.mm(), &point)?;
    require(feet.in_front(), Rejection::Diverging)?;
    Ok(triangulated(point, left, right, right_centre))
}

/// Where two rays pass closest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feet {
    /// λ, along the left ray; negative behind the camera.
    pub left_range: Length,
    /// μ, along the right ray; negative behind the camera.
    pub right_range: Length,
    /// The foot on the left ray.
    pub left: Point<Left>,
    /// The foot on the right ray.
    pub right: Point<Left>,
}

impl Feet {
    /// Halfway between the feet: S.
    #[must_use]
    pub fn midpoint(&self) -> Point<Left> {
        Point::from_mm((self.left.mm() + self.right.mm()) / 2.0)
    }

    /// Whether both feet are in front of their cameras.
    #[must_use]
    pub fn in_front(&self) -> bool {
        self.left_range.mm() > 0.0 && self.right_range.mm() > 0.0
    }
}

/// The feet of the common perpendicular of two rays. Arguments as for [`pseudo_intersection`].
///
/// # Errors
/// [`Rejection::Parallel`].
pub fn closest_approach(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Feet, Rejection> {
    let (u, v, t) = (left.vector(), right.vector(), right_centre.mm());
    // Cross products, because 1 - (u·v)² has lost half its digits where the rays are nearly parallel.
    let across = u.cross(&v);
    let sine_squared = across.norm_squared();
    require(sine_squared > VANISHING * VANISHING, Rejection::Parallel)?;
    let lambda = t.cross(&v).dot(&across) / sine_squared;
    let mu = t.cross(&u).dot(&across) / sine_squared;
    Ok(Feet {
        left_range: Length::from_mm(lambda),
        right_range: Length::from_mm(mu),
        left: Point::from_mm(lambda * u),
        right: Point::from_mm(t + mu * v),
    })
}

/// The unit normal of the epipolar plane through `point`.
fn plane_normal(t: &Vector3<f64>, point: &Vector3<f64>) -> Result<Vector3<f64>, Rejection> {
    let normal = t.cross(point);
    let length = normal.norm();
    require(length > VANISHING * t.norm() * point.norm(), Rejection::OnBaseline)?;
    Ok(normal / length)
}

fn triangulated(
    point: Vector3<f64>,
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Triangulated {
    let from_right = point - right_centre.mm();
    Triangulated {
        point: Point::from_mm(point),
        left_range: Length::from_mm(point.norm()),
        right_range: Length::from_mm(from_right.norm()),
        // A ray exactly along the baseline lies in every epipolar plane.
        skew: dihedral(left, right, right_centre).unwrap_or_default().abs(),
        parallax: Angle::from_rad(point.cross(&from_right).norm().atan2(point.dot(&from_right))),
    }
}

/// Stated as what must hold, so that a comparison with NaN rejects.
fn require(holds: bool, otherwise: Rejection) -> Result<(), Rejection> {
    if holds { Ok(()) } else { Err(otherwise) }
}
