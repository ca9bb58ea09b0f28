//! Triangulation of two rays: the pseudo-intersection, and other methods for comparison.
//!
//! With u, v the unit rays and t the right centre in the left frame, the feet of the common perpendicular are at
//!
//! ```text
//! λ = ((t × v) · (u × v)) / |u × v|²        μ = ((t × u) · (u × v)) / |u × v|²        S = (λ u + t + μ v) / 2
//! ```
//!
//! The midpoint S is too near by the fraction δ² / (γ² + δ²) of the range, with γ the parallax and δ the angle between
//! the epipolar planes. The pseudo-intersection S' uses S only for its epipolar plane, with n = (t × S) / |t × S| as its
//! normal, and intersects the rays projected onto that plane. With [a, b, c] the determinant:
//!
//! ```text
//! λ' = [t, v, n] / [u, v, n]        μ' = [t, u, n] / [u, v, n]        S' = λ' (u - (u·n) n)
//! ```
//!
//! To first order this plane halves the angle between the two epipolar planes, so S' belongs to the family of Lee and
//! Civera, "Closed-form optimal two-view triangulation based on angular errors", ICCV 2019.

mod angular;
mod edge_plane;
mod kernel;
mod midpoint;
mod rectified;
mod reprojection;

use nalgebra::Vector3;

pub use angular::{AngularNorm, angular};
pub use edge_plane::edge_plane;
pub use kernel::{Kernel, UnknownKernel};
pub use midpoint::{Feet, closest_approach, mid2, midpoint};
pub use rectified::rectified;
pub use reprojection::reprojection;

use crate::epipolar::dihedral;
use crate::{Angle, Left, Length, Point, UnitRay};

/// Sines below this count as zero. It corresponds to a range of 10⁹ baselines, where rounding leaves about seven
/// digits.
const VANISHING: f64 = 1e-9;

/// A triangulated point with its ranges and the angles between its rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulated {
    /// The point in the left frame.
    pub point: Point<Left>,
    /// Distance from the left optical centre.
    pub left_range: Length,
    /// Distance from the right optical centre.
    pub right_range: Length,
    /// The angle between the epipolar planes of the two rays, not negative.
    pub skew: Angle,
    /// The parallax: the angle that the baseline spans as seen from the point.
    pub parallax: Angle,
}

/// Why two rays make no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// The rays, or their projections onto the common epipolar plane, are parallel: the range is infinite.
    #[error("parallel rays")]
    Parallel,
    /// There is no epipolar plane: the point lies on the line through both centres (both rays near an epipole), or the
    /// centres coincide or are not finite.
    #[error("on the baseline")]
    OnBaseline,
    /// The rays meet behind a camera.
    #[error("diverging rays")]
    Diverging,
    /// A ray does not meet the image plane of the rectified view, whose field is less than 180°.
    #[error("outside the rectified view")]
    OutsideView,
    /// The reprojection error has no minimum near the rays.
    #[error("no minimum of the reprojection error")]
    NotConverged,
}

/// Triangulates two rays by their pseudo-intersection S'.
///
/// ```
/// # use nalgebra::Vector3;
/// # use vergence_vision::{Left, Point, UnitRay, pseudo_intersection};
/// let point = Vector3::new(50.0, 20.0, 800.0);
/// let centre = Point::<Left>::from_mm(Vector3::new(145.0, 0.0, 0.0));
/// let [left, right] = [point, point - centre.mm()].map(|ray| UnitRay::<Left>::new(ray).expect("a direction"));
/// let found = pseudo_intersection(&left, &right, &centre)?;
/// assert!((found.point.mm() - point).norm() < 1e-9);
/// # Ok::<(), vergence_vision::Rejection>(())
/// ```
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

/// Intersects the rays projected onto the epipolar plane with unit normal `n`; returns the point in millimetres.
fn in_plane(u: &Vector3<f64>, v: &Vector3<f64>, t: &Vector3<f64>, n: &Vector3<f64>) -> Result<Vector3<f64>, Rejection> {
    let determinant = u.cross(v).dot(n);
    require(determinant.abs() > VANISHING, Rejection::Parallel)?;
    let lambda = t.cross(v).dot(n) / determinant;
    let mu = t.cross(u).dot(n) / determinant;
    require(lambda > 0.0 && mu > 0.0, Rejection::Diverging)?;
    Ok(lambda * (u - n * u.dot(n)))
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

/// Takes the condition that must hold, so that a comparison with NaN rejects.
pub(crate) fn require<E>(holds: bool, otherwise: E) -> Result<(), E> {
    if holds { Ok(()) } else { Err(otherwise) }
}
