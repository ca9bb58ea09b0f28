//! The uncertainty of a point from the noise of its two pixels and from the errors of lenses and pose that all points
//! share.
//!
//! With u, v the rays, λ and μ the ranges, n the normal of the epipolar plane and s = [u, v, n] the sine of the
//! parallax, a pseudo-intersected point moves to first order with the rays by
//!
//! ```text
//! G_u = λ [v (n × u)ᵀ / s + n nᵀ / 2]        G_v = μ [-u (n × v)ᵀ / s + n nᵀ / 2]
//! ```
//!
//! A turn in the epipolar plane moves the point along the other ray; a turn across it counts half. The right ray turns
//! with the relative pose, and both turn with their lenses; a shift of the right centre by δ acts as a turn of its ray
//! by δ / μ.
//!
//! A point triangulated by [`crate::edge_plane`] lies where the rays cross in the projection along the edge e, and
//! midway between them along e. With λ u = t + μ v at the point, D = [u, v, e] and w = (u (v × e)ᵀ + v (e × u)ᵀ + e (u
//! × v)ᵀ) w / D for any w, the derivatives of λ = [t, v, e] / D and μ = [t, u, e] / D in (λ u + t + μ v) / 2 are
//!
//! ```text
//! G_u = λ [v (e × u)ᵀ + e (u × v)ᵀ / 2] / D        G_v = μ [-u (e × v)ᵀ + e (u × v)ᵀ / 2] / D
//! ```
//!
//! A ray of a lens with a moving pupil starts at o = (0, 0, e(θ)) of its camera. The point is then that of the two origins, with t = t + R
//! o_right - o_left, moved by o_left; and with G_v / μ the movement per shift of the right origin, it moves by
//!
//! ```text
//! (1 - G_v / μ) ∂o_left + (G_v / μ) R ∂o_right        ∂o = z (e' ∂θ + (θ / sin θ - 1) (∂e0 + θ² ∂e1))
//! ```
//!
//! The first pair of formulas is the case e = n. An error of e itself does not move the point to first order, because
//! the rays meet; where a match slipped by h along the edge, an edge direction wrong by an angle ε moves it by about h
//! ε.

use nalgebra::{Matrix3, RowSVector, SMatrix, Vector3};

use crate::lens_derivatives::{LENS_PARAMETERS, PUPIL};
use crate::{Angle, Kernel, Left, MatchSigma, Point, Right, SHARED_PARAMETERS, SharedCovariance, StereoPair, UnitRay};

/// The uncertainty of one point, as its covariance from pixel noise and its derivative by the shared parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointUncertainty {
    /// Covariance from the noise of its two pixels alone, in mm², left frame.
    pub from_pixels: Matrix3<f64>,
    /// Derivative of the point by the shared parameters, in the order of [`SharedCovariance`], in mm per unit of each.
    pub by_shared: SMatrix<f64, 3, SHARED_PARAMETERS>,
}

impl PointUncertainty {
    /// The uncertainty of a pseudo-intersected `point` of `pair`, for pixels with the standard deviations `sigma`: one
    /// number for each coordinate of each image, or [`MatchSigma`].
    ///
    /// `None` for a point on the line through both centres, and where an argument is not finite.
    #[must_use]
    pub fn of(point: &Point<Left>, pair: &StereoPair<'_>, sigma: impl Into<MatchSigma>) -> Option<Self> {
        Self::by(&Kernel::default(), point, pair, sigma)
    }

    /// The uncertainty of a point triangulated by `kernel`; the other arguments are those of [`Self::of`].
    ///
    /// [`Kernel::EdgePlane`] has a covariance of its own, and none (`None`) for an edge in the epipolar plane. For the
    /// other methods the covariance is that of the pseudo-intersection, to which they agree to first order in the
    /// epipolar plane.
    #[must_use]
    pub fn by(
        kernel: &Kernel,
        point: &Point<Left>,
        pair: &StereoPair<'_>,
        sigma: impl Into<MatchSigma>,
    ) -> Option<Self> {
        let sigma = sigma.into();
        let edge = match kernel {
            Kernel::EdgePlane(edge) => Some(edge.vector()),
            _ => None,
        };
        let turn = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        let (left, in_right) =
            (pair.left.ray_to(point)?, pair.right.ray_to(&(pair.left_from_right.inverse() * *point))?);
        let (at_left, at_right) = (pair.left.derivatives(&left), pair.right.derivatives(&in_right));
        let between = pair.between(at_left.origin, at_right.origin);
        let (seen, centre) = (point.mm() - at_left.origin, between.left_from_right.origin().mm());
        let (mut by_left, mut by_right) = by_rays(&seen, &centre, edge)?;
        let by_shift = by_right / (seen - centre).norm();
        let right = turn * in_right.vector();
        let right_origin = turn * at_right.origin;
        let by_turn = -by_right * right.cross_matrix() - by_shift * right_origin.cross_matrix();
        by_right *= turn;
        let by_left_origin = (Matrix3::identity() - by_shift).column(2).into_owned();
        let by_right_origin = by_shift * turn.column(2);
        by_left += by_left_origin * at_left.origin_by_ray;
        by_right += by_right_origin * at_right.origin_by_ray;

        let left_pixel = by_left * at_left.ray_by_pixel;
        let right_pixel = by_right * at_right.ray_by_pixel;
        let back = turn.transpose() * centre;
        let left_noise = by_left * sigma.of_ray(&at_left.ray_by_pixel, &left.vector(), &centre);
        let right_noise = by_right * sigma.of_ray(&at_right.ray_by_pixel, &in_right.vector(), &back);
        let from_pixels = left_noise * left_noise.transpose() + right_noise * right_noise.transpose();

        // At a fixed pixel, a change of the lens turns the ray the other way than it moves the pixel.
        let mut by_shared = SMatrix::<f64, 3, SHARED_PARAMETERS>::zeros();
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(0).copy_from(&(-left_pixel * at_left.pixel_by_lens));
        by_shared
            .fixed_columns_mut::<LENS_PARAMETERS>(LENS_PARAMETERS)
            .copy_from(&(-right_pixel * at_right.pixel_by_lens));
        for (j, column) in PUPIL.into_iter().enumerate() {
            by_shared.set_column(column, &(by_left_origin * at_left.origin_by_pupil[j]));
            by_shared.set_column(LENS_PARAMETERS + column, &(by_right_origin * at_right.origin_by_pupil[j]));
        }
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS).copy_from(&by_turn);
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS + 3).copy_from(&by_shift);
        let finite = from_pixels.iter().chain(by_shared.iter()).all(|value| value.is_finite());
        finite.then_some(Self { from_pixels, by_shared })
    }

    /// The point's total covariance in mm², left frame.
    #[must_use]
    pub fn covariance(&self, shared: &SharedCovariance) -> Matrix3<f64> {
        self.from_pixels + self.covariance_with(self, shared)
    }

    /// The cross-covariance of this point (rows) and `other` (columns) from the shared parameters, in mm², left frame.
    ///
    /// Points of one pair share the errors of lenses and pose, so the difference of two near points is better known
    /// than either.
    #[must_use]
    pub fn covariance_with(&self, other: &Self, shared: &SharedCovariance) -> Matrix3<f64> {
        shared.between(&self.by_shared, &other.by_shared)
    }
}

/// The uncertainty of the angle of [`crate::ray_to_plane`], from pixel noise and by the shared parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualUncertainty {
    /// Variance from the noise of the two pixels alone, in rad².
    pub from_pixels: f64,
    /// Derivative of the angle by the shared parameters, in the order of [`SharedCovariance`], in radians per unit of
    /// each.
    pub by_shared: RowSVector<f64, SHARED_PARAMETERS>,
}

impl ResidualUncertainty {
    /// The uncertainty for two rays near one epipolar plane, each in its own camera's frame.
    ///
    /// With t of unit length, the angle is [t, u, v] over the larger of |t × u| and |t × v|; it depends on all three
    /// vectors. `None` where both rays lie along the baseline.
    #[must_use]
    pub fn of(
        left: &UnitRay<Left>,
        right: &UnitRay<Right>,
        pair: &StereoPair<'_>,
        sigma: impl Into<MatchSigma>,
    ) -> Option<Self> {
        let sigma = sigma.into();
        let turn = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        let (at_left, at_right) = (pair.left.derivatives(left), pair.right.derivatives(right));
        let centre = pair.between(at_left.origin, at_right.origin).left_from_right.origin();
        let (u, v, t) = (left.vector(), turn * right.vector(), centre.direction()?.vector());
        let (from_u, from_v) = (t.cross(&u), t.cross(&v));
        let sine = from_u.norm().max(from_v.norm());
        // A shift along the baseline does not change the angle.
        let across = u.cross(&v) / (sine * centre.mm().norm());
        let by_shift = (across - t * t.dot(&across)).transpose();
        let (by_left_origin, by_right_origin) = (-by_shift.z, (by_shift * turn).z);
        let by_left_ray = v.cross(&t).transpose() / sine + at_left.origin_by_ray * by_left_origin;
        let by_right_ray = from_u.transpose() / sine * turn + at_right.origin_by_ray * by_right_origin;
        let (by_left, by_right) = (by_left_ray * at_left.ray_by_pixel, by_right_ray * at_right.ray_by_pixel);
        let left_noise = by_left_ray * sigma.of_ray(&at_left.ray_by_pixel, &left.vector(), &t);
        let right_noise = by_right_ray * sigma.of_ray(&at_right.ray_by_pixel, &right.vector(), &(turn.transpose() * t));
        let right_origin = turn * at_right.origin;
        let by_turn = v.cross(&(from_u / sine)).transpose() - by_shift * right_origin.cross_matrix();

        let mut by_shared = RowSVector::<f64, SHARED_PARAMETERS>::zeros();
        by_shared.fixed_columns_mut::<LENS_PARAMETERS>(0).copy_from(&(-by_left * at_left.pixel_by_lens));
        by_shared
            .fixed_columns_mut::<LENS_PARAMETERS>(LENS_PARAMETERS)
            .copy_from(&(-by_right * at_right.pixel_by_lens));
        for (j, column) in PUPIL.into_iter().enumerate() {
            by_shared[column] = by_left_origin * at_left.origin_by_pupil[j];
            by_shared[LENS_PARAMETERS + column] = by_right_origin * at_right.origin_by_pupil[j];
        }
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS).copy_from(&by_turn);
        by_shared.fixed_columns_mut::<3>(2 * LENS_PARAMETERS + 3).copy_from(&by_shift);
        let from_pixels = left_noise.norm_squared() + right_noise.norm_squared();
        let finite = from_pixels.is_finite() && by_shared.iter().all(|value| value.is_finite());
        finite.then_some(Self { from_pixels, by_shared })
    }

    /// The standard deviation of the angle.
    #[must_use]
    pub fn sigma(&self, shared: &SharedCovariance) -> Angle {
        let from_shared = shared.between(&self.by_shared, &self.by_shared).x.max(0.0);
        Angle::from_rad((self.from_pixels + from_shared).sqrt())
    }
}

/// The matrices G_u and G_v in millimetres per radian. `along` is the edge; `None` takes the normal of the epipolar
/// plane.
fn by_rays(
    point: &Vector3<f64>,
    right_centre: &Vector3<f64>,
    along: Option<Vector3<f64>>,
) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    // Below this sine to the baseline the range counts as unbounded; an edge is in the epipolar plane below this sine
    // to it, relative to that of the parallax.
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
