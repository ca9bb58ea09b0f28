//! Pseudo-intersection of whole arrays of rays, with the covariance from angular noise.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::{Matrix3, Vector3};

use super::Instructions;
use super::lanes::{ALWAYS_FUSED, multiply_add};
use super::pairs::{Rows, for_pairs};
use super::vectors::{cross, dot, sum};
use crate::{Angle, Left, Point};

/// Rows per step. The loop over them is so long that the compiler makes vectors of its rounds.
const ROWS: usize = 64;
/// Squared sine below which rays count as parallel, or a point as on the baseline.
const VANISHING_SQUARED: f64 = 1e-18;

/// Points and covariances of [`triangulate_batch`], in the rows of their rays. Rows are NaN where the rays make no
/// point.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchTriangulation {
    /// Points: N × 3, millimetres, left frame.
    pub points: Vec<[f64; 3]>,
    /// Covariances: N × 4, mm², as xx, xh, hh and nn in each point's own axes: x along the baseline, h away from it
    /// through the point, n across the epipolar plane. The other elements are zero.
    pub covariances: Vec<[f64; 4]>,
    right_centre: Point<Left>,
}

/// Triangulates N pairs of unit rays (N × 3, both in the left frame) by pseudo-intersection, with the closed-form
/// covariance for an angular standard deviation `sigma` of each ray.
///
/// The results are those of [`crate::pseudo_intersection`] and [`crate::covariance()`]; pairs that these refuse give
/// NaN. Rays beyond the shorter array are ignored.
///
/// With x along the baseline B, H the distance from it, λ and μ the ranges:
///
/// ```text
/// xx = σ² [λ⁴ (x - B)² + μ⁴ x²] / (B H)²        xh = σ² [λ⁴ (x - B) + μ⁴ x] / (B² H)
/// hh = σ² (λ⁴ + μ⁴) / B²                        nn = σ² (λ² + μ²) / 4
/// ```
#[must_use]
pub fn triangulate_batch(
    left: &[[f64; 3]],
    right: &[[f64; 3]],
    right_centre: &Point<Left>,
    sigma: Angle,
    instructions: Instructions,
) -> BatchTriangulation {
    let mut out = BatchTriangulation::new(right_centre);
    out.extend([left, right], sigma, instructions);
    out
}

impl BatchTriangulation {
    /// An empty batch for a right camera at `right_centre`.
    #[must_use]
    pub const fn new(right_centre: &Point<Left>) -> Self {
        Self { points: Vec::new(), covariances: Vec::new(), right_centre: *right_centre }
    }

    /// Appends the results of [`triangulate_batch`] for the left and right `rays`.
    pub fn extend(&mut self, rays: [&[[f64; 3]]; 2], sigma: Angle, instructions: Instructions) {
        let count = rays[0].len().min(rays[1].len());
        let rays = rays.map(|rays| &rays[..count]);
        let kernel = Triangulate::new(&self.right_centre, sigma);
        match instructions {
            Instructions::Best => triangulate_best(&kernel, rays, self),
            Instructions::Baseline => triangulate_all::<ALWAYS_FUSED>(&kernel, rays, self),
        }
    }

    /// The covariance of one row in mm², in the left frame; `None` where the row does not exist or has no point.
    #[must_use]
    pub fn covariance(&self, row: usize) -> Option<Matrix3<f64>> {
        let (point, [xx, xh, hh, nn]) = (Vector3::from(*self.points.get(row)?), *self.covariances.get(row)?);
        let x = self.right_centre.direction()?.vector();
        let n = x.cross(&point).try_normalize(0.0)?;
        let h = n.cross(&x);
        let mixed = x * h.transpose() + h * x.transpose();
        Some(x * x.transpose() * xx + mixed * xh + h * h.transpose() * hh + n * n.transpose() * nn)
    }

    /// Removes all rows and keeps their memory.
    pub fn clear(&mut self) {
        self.points.clear();
        self.covariances.clear();
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn triangulate_best(kernel: &Triangulate, rays: [&[[f64; 3]]; 2], out: &mut BatchTriangulation) {
    if target_cfg_f!(target_feature = "fma") {
        triangulate_all::<true>(kernel, rays, out);
    } else {
        triangulate_all::<ALWAYS_FUSED>(kernel, rays, out);
    }
}

#[inline(always)]
fn triangulate_all<const FUSED: bool>(kernel: &Triangulate, rays: [&[[f64; 3]]; 2], out: &mut BatchTriangulation) {
    for_pairs::<FUSED, ROWS, 4>(kernel, rays, &mut out.points, &mut out.covariances);
}

/// The parameters of a pair that triangulation needs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Triangulate {
    t: Vector3<f64>,
    /// One over the length of t.
    per_baseline: f64,
    variance: f64,
}

impl<const W: usize> Rows<W, 4> for Triangulate {
    #[inline(always)]
    fn rows<const FUSED: bool>(&self, left: &[[f64; 3]; W], right: &[[f64; 3]; W]) -> ([[f64; 3]; W], [[f64; 4]; W]) {
        let (mut points, mut covariances) = ([[0.0; 3]; W], [[0.0; 4]; W]);
        for j in 0..W {
            (points[j], covariances[j]) = self.row::<FUSED>(&left[j].into(), &right[j].into());
        }
        (points, covariances)
    }
}

impl Triangulate {
    pub(super) fn new(right_centre: &Point<Left>, sigma: Angle) -> Self {
        let t = right_centre.mm();
        Self { t, per_baseline: 1.0 / t.norm(), variance: sigma.rad() * sigma.rad() }
    }

    /// The point and its covariance, as in [`BatchTriangulation`].
    #[inline(always)]
    fn row<const FUSED: bool>(&self, u: &Vector3<f64>, v: &Vector3<f64>) -> ([f64; 3], [f64; 4]) {
        let place = self.place::<FUSED>(u, v);
        let Place { point: p, left_squared, right_squared, valid, .. } = place;
        let along = dot::<FUSED>(&p, &self.t) * self.per_baseline;
        let beyond = dot::<FUSED>(&place.from_right, &self.t) * self.per_baseline;
        let scale = self.variance * (self.per_baseline * self.per_baseline) + valid;
        let (by_left, by_right) = (scale * left_squared * left_squared, scale * right_squared * right_squared);
        let per_height = 1.0 / self.height_squared(&place).sqrt();
        let (left_beyond, right_along) = (by_left * beyond * per_height, by_right * along * per_height);
        let xx = multiply_add::<FUSED>(left_beyond, beyond, right_along * along) * per_height;
        let across = self.variance * 0.25 * (left_squared + right_squared) + valid;
        (p.add_scalar(valid).into(), [xx, left_beyond + right_along, by_left + by_right, across])
    }

    /// The pseudo-intersection by the formulas of the single-point functions without a square root: n enters only as w wᵀ /
    /// w·w, with w along t × S.
    #[inline(always)]
    pub(super) fn place<const FUSED: bool>(&self, u: &Vector3<f64>, v: &Vector3<f64>) -> Place {
        let t = &self.t;
        let (cross, dot) = (cross::<FUSED>, dot::<FUSED>);
        let (tu, tv, uv) = (cross(t, u), cross(t, v), cross(u, v));
        let (lambda, mu) = (dot(&tv, &uv), dot(&tu, &uv));
        let w = sum::<FUSED>(lambda, &tu, mu, &tv);
        let (ww, determinant) = (dot(&w, &w), dot(&uv, &w));
        let per_determinant = 1.0 / determinant;
        let (left_range, right_range) = (dot(&tv, &w) * per_determinant, dot(&tu, &w) * per_determinant);
        let per_ww = 1.0 / ww;
        let point = sum::<FUSED>(left_range, u, -left_range * dot(u, &w) * per_ww, &w);
        let from_right = point - t;
        let area = cross(t, &point);
        let mut place = Place {
            point,
            from_right,
            left_squared: dot(&point, &point),
            right_squared: dot(&from_right, &from_right),
            area,
            area_squared: dot(&area, &area),
            valid: 0.0,
        };
        let good = lambda > 0.0
            && mu > 0.0
            && left_range > 0.0
            && right_range > 0.0
            && dot(&uv, &uv) > VANISHING_SQUARED
            && determinant * determinant > VANISHING_SQUARED * ww
            && self.height_squared(&place) > VANISHING_SQUARED * place.left_squared;
        place.valid = if good { 0.0 } else { f64::NAN };
        place
    }

    /// The square of the distance of the point from the baseline.
    #[inline(always)]
    fn height_squared(&self, place: &Place) -> f64 {
        place.area_squared * (self.per_baseline * self.per_baseline)
    }
}

/// A pseudo-intersection P, in mm.
pub(super) struct Place {
    pub point: Vector3<f64>,
    /// P - t.
    pub from_right: Vector3<f64>,
    /// |P|².
    pub left_squared: f64,
    /// |P - t|².
    pub right_squared: f64,
    /// t × P.
    pub area: Vector3<f64>,
    pub area_squared: f64,
    /// Zero, or NaN where the rays make no point.
    pub valid: f64,
}
