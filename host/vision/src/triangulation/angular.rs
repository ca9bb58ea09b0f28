//! Triangulation with the least angular error, in closed form.
//!
//! S. H. Lee and J. Civera, "Closed-form optimal two-view triangulation based on angular errors", ICCV 2019. Both rays
//! are turned into one epipolar plane, by angles that are least in one of three norms, and intersected there.

use nalgebra::{Matrix3, Vector3};

use super::{Rejection, Triangulated, in_plane, require, triangulated};
use crate::{Left, Point, UnitRay};

/// The norm of the two angular errors that [`angular`] minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AngularNorm {
    /// L1, the sum of both angles: only the ray nearer to the baseline turns.
    L1,
    /// L2, the sum of the squared sines of both angles.
    L2,
    /// L∞, the larger angle: both rays turn by the same angle.
    Linf,
}

/// Triangulates with the least angular error in `norm`. The other arguments are those of
/// [`crate::pseudo_intersection`].
///
/// # Errors
/// [`Rejection`] for rays that make no point.
pub fn angular(
    norm: AngularNorm,
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_centre: &Point<Left>,
) -> Result<Triangulated, Rejection> {
    let (u, v, t) = (left.vector(), right.vector(), right_centre.mm());
    let along = right_centre.direction().ok_or(Rejection::OnBaseline)?.vector();
    let (from_u, from_v) = (along.cross(&u), along.cross(&v));
    let normal = match norm {
        AngularNorm::L1 if from_u.norm() >= from_v.norm() => from_u,
        AngularNorm::L1 => from_v,
        AngularNorm::L2 => least_squares_normal(&from_u, &from_v, &along),
        AngularNorm::Linf => longer(from_u + from_v, from_u - from_v),
    };
    let normal = normal.try_normalize(super::VANISHING).ok_or(Rejection::OnBaseline)?;
    let point = in_plane(&u, &v, &t, &normal)?;
    require(t.cross(&point).norm() > super::VANISHING * t.norm() * point.norm(), Rejection::OnBaseline)?;
    Ok(triangulated(point, left, right, right_centre))
}

fn longer(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    if a.norm_squared() >= b.norm_squared() { a } else { b }
}

/// The direction n orthogonal to the baseline with the least (n·u)² + (n·v)². It is the main axis of the normals t × u
/// and t × v, turned by 90° about the baseline.
fn least_squares_normal(from_u: &Vector3<f64>, from_v: &Vector3<f64>, along: &Vector3<f64>) -> Vector3<f64> {
    let spread: Matrix3<f64> = from_u * from_u.transpose() + from_v * from_v.transpose();
    // The matrix has rank two and a known null vector, so its main axis solves a quadratic equation in the plane.
    let x = longer(*from_u, *from_v);
    let Some(x) = x.try_normalize(super::VANISHING) else { return x };
    let y = along.cross(&x);
    let (xx, xy, yy) = (x.dot(&(spread * x)), x.dot(&(spread * y)), y.dot(&(spread * y)));
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    x * angle.cos() + y * angle.sin()
}
