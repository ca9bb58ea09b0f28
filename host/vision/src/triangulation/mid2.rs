//! The midpoint of the points at the ranges that the law of sines gives.
//!
//! S. H. Lee and J. Civera, "Triangulation: why optimize?", BMVC 2019, the method without weights: λ = |t × v| / |u × v| and
//! μ = |t × u| / |u × v|, and their test that the rays meet in front.

use super::{Rejection, Triangulated, VANISHING, plane_normal, require, triangulated};
use crate::{Left, Point, UnitRay};

/// The point of "mid2". Arguments as for [`crate::pseudo_intersection`].
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
    // With a ray reversed the ends would be nearer to each other: the rays meet behind a camera.
    let reversed = [along_left + along_right, -along_left - along_right, along_left - along_right];
    require(reversed.iter().all(|turned| apart < (t + turned).norm_squared()), Rejection::Diverging)?;
    let point = (along_left + t + along_right) / 2.0;
    plane_normal(&t, &point)?;
    Ok(triangulated(point, left, right, right_centre))
}
