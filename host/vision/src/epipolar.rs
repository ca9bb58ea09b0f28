//! Epipolar residuals: angles by which two rays miss a common epipolar plane.
//!
//! An epipolar plane contains the baseline and a ray. With `t` the unit vector of the baseline and `u`, `v` the rays,
//! all in the left frame, the angles follow from the determinant [t, u, v] and the normals t × u and t × v. Nothing
//! divides by z, so that rays past 90° need no special case.

use crate::{Angle, Left, Point, UnitRay};

/// Sine to the baseline below which a ray spans no plane with it: a thousandth of a microradian, far below any pixel.
const ALONG_BASELINE: f64 = 1e-9;

/// The signed angle between the epipolar planes of the two rays, about the baseline from left to right.
///
/// `right` is the right camera's ray turned into the left frame. From -180° to 180°; positive where the right ray's
/// half-plane is turned ahead of the left ray's. `None` where a ray lies along the baseline or the centres coincide.
/// Near an epipole a small error of the ray turns its plane by much: use [`ray_to_plane`] for gates.
#[must_use]
pub fn dihedral(left: &UnitRay<Left>, right: &UnitRay<Left>, right_centre: &Point<Left>) -> Option<Angle> {
    let t = right_centre.direction()?.vector();
    let (left_normal, right_normal) = (t.cross(&left.vector()), t.cross(&right.vector()));
    let spanned = left_normal.norm() > ALONG_BASELINE && right_normal.norm() > ALONG_BASELINE;
    // (t × u) × (t × v) = t [t, u, v]
    let (sine, cosine) = (left_normal.dot(&right.vector()), left_normal.dot(&right_normal));
    spanned.then(|| Angle::from_rad(sine.atan2(cosine)))
}

/// The signed angle of one ray to the epipolar plane of the other.
///
/// The plane is that of the ray farther from the baseline, so that the angle stays well determined until both rays lie
/// along the baseline.
///
/// This is the smallest angle by which one ray must turn for both to meet: the L1 angular error of Lee and Civera,
/// "Closed-form optimal two-view triangulation based on angular errors", ICCV 2019. It has the sign of [`dihedral`];
/// `None` where both rays lie along the baseline or the centres coincide.
#[must_use]
pub fn ray_to_plane(left: &UnitRay<Left>, right: &UnitRay<Left>, right_centre: &Point<Left>) -> Option<Angle> {
    let t = right_centre.direction()?.vector();
    let left_normal = t.cross(&left.vector());
    let farther = left_normal.norm().max(t.cross(&right.vector()).norm());
    let sine = left_normal.dot(&right.vector()) / farther;
    (farther > ALONG_BASELINE).then(|| Angle::from_rad(sine.clamp(-1.0, 1.0).asin()))
}
