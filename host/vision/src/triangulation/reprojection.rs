//! Triangulation with the least reprojection error, the maximum likelihood for equal noise in all pixel coordinates.
//!
//! R. Hartley and A. Zisserman, *Multiple View Geometry*, 2004, §12.3. Solved by Gauss-Newton with Levenberg's damping,
//! starting at the pseudo-intersection.

use nalgebra::{Matrix3, Vector3};

use super::{Rejection, Triangulated, pseudo_intersection, triangulated};
use crate::{Frame, KannalaBrandt, Left, Pixel, PixelPair, Point, Right, StereoPair, UnitRay};

/// Largest number of iterations; from a start within a pixel, three or four suffice.
const ITERATIONS: usize = 30;
/// A step below this fraction of the range ends the search.
const SMALL_STEP: f64 = 1e-12;

/// Finds the point whose projections are nearest to `pixels`.
///
/// `left` and `right` are the rays of these pixels, each in its own camera's frame.
///
/// # Errors
/// [`Rejection`] for rays that make no point; [`Rejection::NotConverged`] where no minimum is found.
pub fn reprojection(
    pixels: &PixelPair,
    left: &UnitRay<Left>,
    right: &UnitRay<Right>,
    pair: &StereoPair<'_>,
) -> Result<Triangulated, Rejection> {
    let in_left = pair.left_from_right * *right;
    let centre = pair.left_from_right.origin();
    let mut point = pseudo_intersection(left, &in_left, &centre)?.point.mm();
    let mut best = Errors::at(&point, pixels, pair).ok_or(Rejection::NotConverged)?;
    let mut damping = 1e-9;
    for _ in 0..ITERATIONS {
        let damped = best.normal + Matrix3::from_diagonal(&(best.normal.diagonal() * damping));
        let step = damped.cholesky().ok_or(Rejection::NotConverged)?.solve(&-best.gradient);
        let small = step.norm() <= SMALL_STEP * point.norm();
        match Errors::at(&(point + step), pixels, pair).filter(|errors| errors.cost <= best.cost) {
            Some(better) => (point, best, damping) = (point + step, better, damping * 0.1),
            None => damping = (damping * 10.0).max(1e-6),
        }
        if small {
            return Ok(triangulated(point, left, &in_left, &centre));
        }
    }
    Err(Rejection::NotConverged)
}

/// The sum of squared reprojection errors in px², half its gradient and its normal matrix by the point's coordinates.
struct Errors {
    cost: f64,
    gradient: Vector3<f64>,
    normal: Matrix3<f64>,
}

impl Errors {
    fn at(point: &Vector3<f64>, pixels: &PixelPair, pair: &StereoPair<'_>) -> Option<Self> {
        let in_left = Point::<Left>::from_mm(*point);
        let in_right = pair.left_from_right.inverse() * in_left;
        let mut errors = Self { cost: 0.0, gradient: Vector3::zeros(), normal: Matrix3::zeros() };
        errors.add(pair.left, &in_left, pixels.left, &Matrix3::identity())?;
        let left_from_right = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        errors.add(pair.right, &in_right, pixels.right, &left_from_right)?;
        Some(errors)
    }

    fn add<F: Frame>(
        &mut self,
        lens: &KannalaBrandt,
        point: &Point<F>,
        pixel: Pixel,
        left_from_camera: &Matrix3<f64>,
    ) -> Option<()> {
        let ray = point.direction()?;
        let seen = lens.project(&ray).ok()?;
        let error = nalgebra::Vector2::new(seen.u - pixel.u, seen.v - pixel.v);
        let by_point = lens.pixel_by_ray(&ray) * left_from_camera.transpose() / point.mm().norm();
        self.cost += error.norm_squared();
        self.gradient += by_point.transpose() * error;
        self.normal += by_point.transpose() * by_point;
        Some(())
    }
}
