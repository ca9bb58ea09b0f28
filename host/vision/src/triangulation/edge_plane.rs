//! Triangulation of matches on a straight edge.
//!
//! A match may slip along an edge without being noticed. In the projection along the edge, both rays are lines in a
//! plane, and their crossing does not move when a match slips.

use super::{Rejection, Triangulated, VANISHING, plane_normal, require, triangulated};
use crate::{Left, Point, UnitRay};

/// Triangulates in the projection along `edge`: the point where both rays cross there, midway between them along the
/// edge.
///
/// With e the edge: λ = [t, v, e] / [u, v, e], μ = [t, u, e] / [u, v, e], and the point is (λ u + t + μ v) / 2. The
/// other arguments are those of [`crate::pseudo_intersection`].
///
/// # Errors
/// [`Rejection`] for rays that make no point; [`Rejection::Parallel`] for an edge in the epipolar plane, which fixes no
/// range.
pub fn edge_plane(
    edge: &UnitRay<Left>,
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Triangulated, Rejection> {
    let (e, u, v, t) = (edge.vector(), left.vector(), right.vector(), right_centre.mm());
    let determinant = u.cross(&v).dot(&e);
    require(determinant.abs() > VANISHING, Rejection::Parallel)?;
    let lambda = t.cross(&v).dot(&e) / determinant;
    let mu = t.cross(&u).dot(&e) / determinant;
    require(lambda > 0.0 && mu > 0.0, Rejection::Diverging)?;
    let point = (lambda * u + t + mu * v) / 2.0;
    plane_normal(&t, &point)?;
    Ok(triangulated(point, left, right, right_centre))
}
