//! Triangulation by midpoints between two rays.
//!
//! [`midpoint`] is the middle of the common perpendicular. [`mid2`] is the middle of the points at the ranges that the
//! law of sines gives: λ = |t × v| / |u × v| and μ = |t × u| / |u × v|, the method without weights of S. H. Lee and J.
//! Civera, "Triangulation: why optimize?", BMVC 2019, with their test for rays that meet behind a camera.

use super::{Rejection, Triangulated, VANISHING, plane_normal, require, triangulated};
use crate::{Left, Length, Point, UnitRay};

/// The feet of the common perpendicular of two rays: their points closest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feet {
    /// Distance λ of the foot along the left ray; negative behind the camera.
    pub left_range: Length,
    /// Distance μ of the foot along the right ray; negative behind the camera.
    pub right_range: Length,
    /// The foot on the left ray.
    pub left: Point<Left>,
    /// The foot on the right ray.
    pub right: Point<Left>,
}

impl Feet {
    /// The point S midway between the feet.
    #[must_use]
    #[inline]
    pub fn midpoint(&self) -> Point<Left> {
        Point::from_mm((self.left.mm() + self.right.mm()) / 2.0)
    }

    /// Whether both feet are in front of their cameras.
    #[must_use]
    #[inline]
    pub fn in_front(&self) -> bool {
        self.left_range.mm() > 0.0 && self.right_range.mm() > 0.0
    }
}

/// Finds the feet of the common perpendicular of two rays. The arguments are those of [`crate::pseudo_intersection`].
///
/// # Errors
/// [`Rejection::Parallel`] for parallel rays.
#[inline]
pub fn closest_approach(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Feet, Rejection> {
    let (u, v, t) = (left.vector(), right.vector(), right_centre.mm());
    // Cross products are used because 1 - (u·v)² loses half its digits for nearly parallel rays.
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

/// Triangulates two rays by the midpoint S of their common perpendicular, the textbook method.
///
/// It is biased towards the cameras where the rays are skew. The arguments are those of [`crate::pseudo_intersection`].
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

/// Triangulates by "mid2": the midpoint of the points on both rays at the ranges from the law of sines.
///
/// The arguments are those of [`crate::pseudo_intersection`].
///
/// # Errors
/// [`Rejection`] for rays that make no point.
pub fn mid2(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Triangulated, Rejection> {
    let (u, v, t) = (left.vector(), right.vector(), right_centre.mm());
    let sine = u.cross(&v).norm();
    require(sine > VANISHING, Rejection::Parallel)?;
    let (along_left, along_right) = (u * (t.cross(&v).norm() / sine), v * (t.cross(&u).norm() / sine));
    let apart = (t + along_right - along_left).norm_squared();
    // If the ends are nearer to each other with a ray reversed, the rays meet behind a camera.
    let reversed = [along_left + along_right, -along_left - along_right, along_left - along_right];
    require(reversed.iter().all(|turned| apart < (t + turned).norm_squared()), Rejection::Diverging)?;
    let point = (along_left + t + along_right) / 2.0;
    plane_normal(&t, &point)?;
    Ok(triangulated(point, left, right, right_centre))
}
