//! Triangulation from the disparity of a rectified pair, the method of ordinary stereo, for comparison.
//!
//! Both images are projected onto one plane parallel to the baseline (A. Fusiello, E. Trucco and A. Verri, "A compact
//! algorithm for rectification of stereo pairs", 2000). With x along the baseline B and z along the mean of the optical
//! axes as far as it is orthogonal to x, a point has one row y in both views and
//!
//! ```text
//! Z = B / (x_left - x_right)        X = Z x_left        Y = Z (y_left + y_right) / 2
//! ```

use nalgebra::{Matrix3, Vector3};

use super::{Rejection, Triangulated, VANISHING, require, triangulated};
use crate::{Left, Right, Transform, UnitRay};

/// Triangulates two rays by their disparity in the rectified views. `right` is in the right camera's own frame.
///
/// # Errors
/// [`Rejection`] for rays that make no point, and for rays 90° or more off the axis of the rectified views.
pub fn rectified(
    left: &UnitRay<Left>,
    right: &UnitRay<Right>,
    left_from_right: &Transform<Left, Right>,
) -> Result<Triangulated, Rejection> {
    let in_left = *left_from_right * *right;
    let centre = left_from_right.origin();
    let view_from_left = view_axes(left_from_right).ok_or(Rejection::OnBaseline)?;
    let (u, v) = (view_from_left * left.vector(), view_from_left * in_left.vector());
    require(u.z > VANISHING && v.z > VANISHING, Rejection::OutsideView)?;
    let disparity = u.x / u.z - v.x / v.z;
    require(disparity.abs() > VANISHING, Rejection::Parallel)?;
    require(disparity > 0.0, Rejection::Diverging)?;
    let depth = centre.mm().norm() / disparity;
    let in_view = Vector3::new(u.x / u.z, 0.5 * (u.y / u.z + v.y / v.z), 1.0) * depth;
    Ok(triangulated(view_from_left.transpose() * in_view, left, &in_left, &centre))
}

/// The rectified view's axes as rows, in the left frame.
fn view_axes(left_from_right: &Transform<Left, Right>) -> Option<Matrix3<f64>> {
    let x = left_from_right.origin().direction()?.vector();
    let forward = Vector3::z() + left_from_right.rotation() * Vector3::z();
    let z = (forward - x * forward.dot(&x)).try_normalize(VANISHING)?;
    Some(Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]))
}
