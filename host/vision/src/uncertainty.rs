//! What a point's uncertainty is made of: the noise of its own two pixels, and the errors that all points of a pair share.
//!
//! With u, v the rays, λ and μ the ranges, n the normal of the epipolar plane and s = [u, v, n] the sine of the parallax, a
//! pseudo-intersected point moves to first order with the rays by
//!
//! ```text
//! G_u = λ [v (n × u)ᵀ / s + n nᵀ / 2]        G_v = μ [-u (n × v)ᵀ / s + n nᵀ / 2]
//! ```
//!
//! in the plane along the other ray, across it by the mean of both. The right ray turns with the relative pose, both turn
//! with their lenses; a shift of the right centre by δ acts as a turn of its ray by δ / μ.
//!
//! A point triangulated in the plane of an edge e takes its place from where the rays cross as seen along e, and the mean of
//! both along it. With λ u = t + μ v at the point, D = [u, v, e] and w = (u (v × e)ᵀ + v (e × u)ᵀ + e (u × v)ᵀ) w / D for any
//! w, the derivatives of λ = [t, v, e] / D and μ = [t, u, e] / D in (λ u + t + μ v) / 2 come to
//!
//! ```text
//! G_u = λ [v (e × u)ᵀ + e (u × v)ᵀ / 2] / D        G_v = μ [-u (e × v)ᵀ + e (u × v)ᵀ / 2] / D
//! ```
//!
//! of which the first pair is the case e = n. By e itself the point does not move to first order, because the rays meet;
//! where a match slipped by h along the edge, an edge that is wrong by an angle ε costs about h ε.

use nalgebra::{Matrix3, Matrix6, RowSVector, SMatrix, Vector3, Vector6};

use crate::lens_derivatives::LENS_PARAMETERS;
use crate::{Angle, Kernel, Left, Point, Right, StereoPair, UnitRay};

/// Both lenses and the pose.
pub const SHARED_PARAMETERS: usize = 2 * LENS_PARAMETERS + 6;

/// The covariance of what all points of a pair share, in this order: left lens, right lens (each fx, fy, cx, cy in pixels
/// and k1 to k4 as OpenCV has them), then the relative pose as a turn ω about the left axes in radians and a shift δ of the
/// right camera in the left frame in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedCovariance(SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>);

impl SharedCovariance {
    /// Lenses and pose known exactly.
    #[must_use]
    pub fn exact() -> Self {
        Self(SMatrix::zeros())
    }

    /// With all correlations, of lenses and pose calibrated together.
    #[must_use]
    pub const fn joint(covariance: SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>) -> Self {
        Self(covariance)
    }

    /// The same with another covariance of the pose, which then is independent of the lenses.
    #[must_use]
    pub fn with_pose(mut self, covariance: &Matrix6<f64>) -> Self {
        const POSE: usize = 2 * LENS_PARAMETERS;
        self.0.fixed_columns_mut::<6>(POSE).fill(0.0);
        self.0.fixed_rows_mut::<6>(POSE).fill(0.0);
        self.0.fixed_view_mut::<6, 6>(POSE, POSE).copy_from(covariance);
        self
    }

    /// The same with lenses calibrated independently of each other and of the pose.
    #[must_use]
    pub fn with_lenses(mut self, lenses: [&SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>; 2]) -> Self {
        for (lens, first) in lenses.into_iter().zip([0, LENS_PARAMETERS]) {
            self.0.fixed_columns_mut::<LENS_PARAMETERS>(first).fill(0.0);
            self.0.fixed_rows_mut::<LENS_PARAMETERS>(first).fill(0.0);
            self.0.fixed_view_mut::<LENS_PARAMETERS, LENS_PARAMETERS>(first, first).copy_from(lens);
        }
        self
    }

    /// The covariance in the stated order.
    #[must_use]
    pub const fn matrix(&self) -> &SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS> {
        &self.0
    }
}

/// How one point depends on its pixels and on what is shared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointUncertainty {
    /// Covariance from the noise of its two pixels alone, mm², left frame.
    pub from_pixels: Matrix3<f64>,
    /// Derivative of the point by the shared parameters, in the order of [`SharedCovariance`], mm per unit of each.
    pub by_shared: SMatrix<f64, 3, SHARED_PARAMETERS>,
}

impl PointUncertainty {
    /// Of `point` as `pair` sees it, for noise of `pixel_sigma` pixels in each coordinate of each image. `None` on the line
    /// through both centres and where an argument is not finite.
    #[must_use]
    pub fn of(point: &Point<Left>, pair: &StereoPair<'_>, pixel_sigma: f64) -> Option<Self> {
        Self::by(&Kernel::default(), point, pair, pixel_sigma)
    }

    /// The same of a point made by `kernel`. [`Kernel::EdgePlane`] has a covariance of its own, and none for an edge in the
    /// epipolar plane; the others have that of the pseudo-intersection to first order in the plane, where the range lies.
    #[must_use]
    pub fn by(kernel: &Kernel, point: &Point<Left>, pair: &StereoPair<'_>, pixel_sigma: f64) -> Option<Self> {
        let edge = match kernel {
            Kernel::EdgePlane(edge) => Some(edge.vector()),
            _ => None,
        };
        let turn = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        let (left, in_right) = (point.direction()?, (pair.left_from_right.inverse() * *point).direction()?);
        let (by_left, by_right) = by_rays(&point.mm(), &pair.left_from_right.origin().mm(), edge)?;
        let right_range = (point.mm() - pair.left_from_right.origin().mm()).norm();

        let (left_by_pixel, left_by_lens) = pair.left.ray_by_pixel_and_pixel_by_lens(&left);
        let (right_by_pixel, right_by_lens) = pair.right.ray_by_pixel_and_pixel_by_lens(&in_right);
        let left_pixel = by_left * left_by_pixel;
        let right_pixel = by_right * turn * right_by_pixel;
        let from_pixels =
            (left_pixel * left_pixel.transpose() + right_pixel * right_pixel.transpose()) * (pixel_sigma * pixel_sigma);

        // At a fixed pixel the ray turns against what the lens does.
        let mut by_shared = SMatrix::<f64, 3, SHARED_PARAMETERS>::zeros();
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(0).copy_from(&(-left_pixel * left_by_lens));
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(LENS_PARAMETERS).copy_from(&(-right_pixel * right_by_lens));
        let right = turn * in_right.vector();
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS).copy_from(&(-by_right * right.cross_matrix()));
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS + 3).copy_from(&(by_right / right_range));
        let finite = from_pixels.iter().chain(by_shared.iter()).all(|value| value.is_finite());
        finite.then_some(Self { from_pixels, by_shared })
    }

    /// The point's whole covariance, mm², left frame.
    #[must_use]
    pub fn covariance(&self, shared: &SharedCovariance) -> Matrix3<f64> {
        self.from_pixels + self.covariance_with(self, shared)
    }

    /// The covariance of the errors of this point (rows) and `other` (columns): what they share, mm². The same pair's
    /// points lean the same way, so differences between near points are better known than the points.
    #[must_use]
    pub fn covariance_with(&self, other: &Self, shared: &SharedCovariance) -> Matrix3<f64> {
        self.by_shared * shared.0 * other.by_shared.transpose()
    }
}

/// How the angle between two rays and one epipolar plane, see [`crate::ray_to_plane`], depends on their pixels and on what
/// is shared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualUncertainty {
    /// Variance from the noise of the two pixels alone, rad².
    pub from_pixels: f64,
    /// Derivative of the angle by the shared parameters, in the order of [`SharedCovariance`], radians per unit of each.
    pub by_shared: RowSVector<f64, SHARED_PARAMETERS>,
}

impl ResidualUncertainty {
    /// For two rays that are near one epipolar plane, `right` in the right camera's own frame. `None` where both lie along
    /// the baseline.
    ///
    /// The angle is [t, u, v] over the larger of |t × u| and |t × v|, t of unit length, and changes with each of the three.
    #[must_use]
    pub fn of(left: &UnitRay<Left>, right: &UnitRay<Right>, pair: &StereoPair<'_>, pixel_sigma: f64) -> Option<Self> {
        let turn = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        let centre = pair.left_from_right.origin();
        let (u, v, t) = (left.vector(), turn * right.vector(), centre.direction()?.vector());
        let (from_u, from_v) = (t.cross(&u), t.cross(&v));
        let sine = from_u.norm().max(from_v.norm());
        let (left_by_pixel, left_by_lens) = pair.left.ray_by_pixel_and_pixel_by_lens(left);
        let (right_by_pixel, right_by_lens) = pair.right.ray_by_pixel_and_pixel_by_lens(right);
        let by_left = v.cross(&t).transpose() / sine * left_by_pixel;
        let by_right = from_u.transpose() / sine * turn * right_by_pixel;
        // The shift along the baseline changes nothing.
        let across = u.cross(&v) / (sine * centre.mm().norm());
        let by_shift = (across - t * t.dot(&across)).transpose();
        let by_turn = v.cross(&(from_u / sine)).transpose();

        let mut by_shared = RowSVector::<f64, SHARED_PARAMETERS>::zeros();
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(0).copy_from(&(-by_left * left_by_lens));
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(LENS_PARAMETERS).copy_from(&(-by_right * right_by_lens));
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS).copy_from(&by_turn);
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS + 3).copy_from(&by_shift);
        let from_pixels = (by_left.norm_squared() + by_right.norm_squared()) * pixel_sigma * pixel_sigma;
        let finite = from_pixels.is_finite() && by_shared.iter().all(|value| value.is_finite());
        finite.then_some(Self { from_pixels, by_shared })
    }

    /// The standard deviation of the angle.
    #[must_use]
    pub fn sigma(&self, shared: &SharedCovariance) -> Angle {
        let from_shared = (self.by_shared * shared.0 * self.by_shared.transpose()).x.max(0.0);
        Angle::from_rad((self.from_pixels + from_shared).sqrt())
    }

    /// The derivative by the pose alone: ω in radians, δ in millimetres.
    pub(crate) fn by_pose(&self) -> Vector6<f64> {
        self.by_shared.fixed_columns::<6>(2 * LENS_PARAMETERS).transpose()
    }
}

/// G_u and G_v, in millimetres per radian; `along` is the edge, or else the normal of the epipolar plane.
fn by_rays(
    point: &Vector3<f64>,
    right_centre: &Vector3<f64>,
    along: Option<Vector3<f64>>,
) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    // The sine to the baseline below which the range is without bound for any purpose, and that of an edge to the epipolar
    // plane as a part of the parallax.
    const VANISHING: f64 = 1e-9;
    let from_right = point - right_centre;
    let (left_range, right_range) = (point.norm(), from_right.norm());
    let normal = right_centre.cross(point);
    let area = normal.norm();
    if area.is_nan() || area <= VANISHING * left_range * right_centre.norm() {
        return None;
    }
    let (u, v, e) = (point / left_range, from_right / right_range, along.unwrap_or(normal / area));
    let across = u.cross(&v);
    let determinant = across.dot(&e);
    if determinant.is_nan() || determinant.abs() <= VANISHING * across.norm() {
        return None;
    }
    let mean = e * across.transpose() / 2.0;
    let by_left = (v * e.cross(&u).transpose() + mean) * (left_range / determinant);
    let by_right = (mean - u * e.cross(&v).transpose()) * (right_range / determinant);
    Some((by_left, by_right))
}
