//! Pairs of rays to points with their covariance.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::Vector3;

use super::Instructions;
use super::lanes::{ALWAYS_FUSED, BLOCK, Kernel, column_results, columns_of, rows_of};
use crate::{Angle, Left, Point};

/// One vector of eight, or two of four: the kernel holds some thirty values per row.
const LANES: usize = 8;
/// Squared sine below which rays are parallel, or a point lies on the baseline.
const VANISHING_SQUARED: f64 = 1e-18;

/// Points and covariances, in the rows of the rays they come from. NaN where the rays make no point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BatchTriangulation {
    /// N × 3, millimetres, left frame.
    pub points: Vec<[f64; 3]>,
    /// N × 6, mm²: xx, xy, xz, yy, yz, zz of [`crate::covariance()`].
    pub covariances: Vec<[f64; 6]>,
}

/// The pseudo-intersections of N pairs of unit rays, both in the left frame, with their closed-form covariance for an
/// angular standard deviation `sigma` of each ray. As [`crate::pseudo_intersection`] and [`crate::covariance()`]; what those
/// refuse is NaN here. Rays beyond the shorter array are not looked at.
#[must_use]
pub fn triangulate_batch(
    left: &[[f64; 3]],
    right: &[[f64; 3]],
    right_centre: &Point<Left>,
    sigma: Angle,
    instructions: Instructions,
) -> BatchTriangulation {
    let mut out = BatchTriangulation::default();
    out.extend([left, right], right_centre, sigma, instructions);
    out
}

impl BatchTriangulation {
    /// Appends what [`triangulate_batch`] returns for the left and right `rays`.
    pub fn extend(
        &mut self,
        rays: [&[[f64; 3]]; 2],
        right_centre: &Point<Left>,
        sigma: Angle,
        instructions: Instructions,
    ) {
        let count = rays[0].len().min(rays[1].len());
        let rays = rays.map(|rays| &rays[..count]);
        let kernel = Triangulate { t: right_centre.mm(), variance: sigma.rad() * sigma.rad() };
        match instructions {
            Instructions::Best => triangulate_best(&kernel, rays, self),
            Instructions::Baseline => triangulate_all::<ALWAYS_FUSED>(&kernel, rays, self),
        }
    }

    /// Forgets the rows and keeps their memory.
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
    let [left, right] = rays;
    out.points.reserve(left.len());
    out.covariances.reserve(left.len());
    let ((left_blocks, left_rest), (right_blocks, right_rest)) = (left.as_chunks(), right.as_chunks());
    for (left, right) in left_blocks.iter().zip(right_blocks) {
        let (points, covariances) = block::<FUSED>(kernel, left, right);
        out.points.extend_from_slice(&points);
        out.covariances.extend_from_slice(&covariances);
    }
    let count = left_rest.len();
    if count > 0 {
        let mut padded = [[[0.0; 3]; BLOCK]; 2];
        padded[0][..count].copy_from_slice(left_rest);
        padded[1][..count].copy_from_slice(right_rest);
        let (points, covariances) = block::<FUSED>(kernel, &padded[0], &padded[1]);
        out.points.extend_from_slice(&points[..count]);
        out.covariances.extend_from_slice(&covariances[..count]);
    }
}

#[inline(always)]
fn block<const FUSED: bool>(
    kernel: &Triangulate,
    left: &[[f64; 3]; BLOCK],
    right: &[[f64; 3]; BLOCK],
) -> ([[f64; 3]; BLOCK], [[f64; 6]; BLOCK]) {
    let ([ux, uy, uz], [vx, vy, vz]) = (columns_of(left), columns_of(right));
    let [px, py, pz, xx, xy, xz, yy, yz, zz] = column_results::<FUSED, LANES, 6, 9>(kernel, &[ux, uy, uz, vx, vy, vz]);
    (rows_of(&[px, py, pz]), rows_of(&[xx, xy, xz, yy, yz, zz]))
}

struct Triangulate {
    t: Vector3<f64>,
    variance: f64,
}

impl Kernel<6, 9> for Triangulate {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, columns: [[f64; W]; 6]) -> [[f64; W]; 9] {
        let mut out = [[0.0; W]; 9];
        for j in 0..W {
            let at = |column: usize| columns[column][j];
            let (u, v) = (Vector3::new(at(0), at(1), at(2)), Vector3::new(at(3), at(4), at(5)));
            for (column, value) in out.iter_mut().zip(self.row(&u, &v)) {
                column[j] = value;
            }
        }
        out
    }
}

impl Triangulate {
    /// The formulas of the single-point functions without a root: n enters only as w wᵀ / w·w, with w along t × S.
    #[inline(always)]
    fn row(&self, u: &Vector3<f64>, v: &Vector3<f64>) -> [f64; 9] {
        let t = &self.t;
        let (tu, tv, uv) = (cross(t, u), cross(t, v), cross(u, v));
        let (lambda, mu) = (dot(&tv, &uv), dot(&tu, &uv));
        let w = lambda * tu + mu * tv;
        let (ww, determinant) = (dot(&w, &w), dot(&uv, &w));
        let (left_range, right_range) = (dot(&tv, &w) / determinant, dot(&tu, &w) / determinant);
        let p = left_range * (u - (dot(u, &w) / ww) * w);
        let q = p - t;

        let (pp, qq, tt) = (dot(&p, &p), dot(&q, &q), dot(t, t));
        let area = cross(t, &p);
        let area_squared = dot(&area, &area);
        let good = lambda > 0.0
            && mu > 0.0
            && left_range > 0.0
            && right_range > 0.0
            && dot(&uv, &uv) > VANISHING_SQUARED
            && determinant * determinant > VANISHING_SQUARED * ww
            && area_squared > VANISHING_SQUARED * tt * pp;
        let valid = if good { 0.0 } else { f64::NAN };

        let in_plane = self.variance / area_squared;
        let (from_left, from_right) = (in_plane * pp * pp, in_plane * qq * qq);
        let across = self.variance * (pp + qq) / (4.0 * ww);
        let c = |i: usize, j: usize| from_left * q[i] * q[j] + from_right * p[i] * p[j] + across * w[i] * w[j] + valid;
        [p.x + valid, p.y + valid, p.z + valid, c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)]
    }
}

#[inline(always)]
fn cross(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

#[inline(always)]
fn dot(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}
