//! Triangulation of whole arrays of rays, with the covariance from pixel noise, lenses and pose.
//!
//! The derivation is that of [`crate::PointUncertainty`], written along three directions: a turn of the left ray moves
//! the point along the right ray v, a turn of the right ray moves it along the left ray u, and both move it along the
//! normal n of their plane. A *gradient* is the movement of the point along one of the three per turn of a ray, in
//! mm/rad:
//!
//! ```text
//! along v: λ n × u / s by the left ray      along u: -μ n × v / s by the right ray      along n: λ n / 2 and μ n / 2
//! ```
//!
//! Only these three rows of derivatives by the shared parameters are multiplied with the shared covariance.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::{Matrix3, Vector3};

use super::Instructions;
use super::lanes::{ALWAYS_FUSED, Kernel, multiply_add};
use super::pairs::for_pairs;
use super::slope::{Gradient, LensSlope};
use super::triangulate::Triangulate;
use super::vectors::{Vectors, cross, dot, scaled, turned, unit};
use crate::lens_derivatives::LENS_PARAMETERS;
use crate::{Angle, SHARED_PARAMETERS, SharedCovariance, StereoPair};

/// Rows per step: one vector of eight lanes, or two of four.
const LANES: usize = 8;

/// A stereo pair prepared for whole arrays of rays: pseudo-intersections with the covariance of
/// [`crate::PointUncertainty::covariance`], several times faster than one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchPair {
    place: Triangulate,
    lenses: [LensSlope; 2],
    left_from_right: Matrix3<f64>,
    shared: [[f64; SHARED_PARAMETERS]; SHARED_PARAMETERS],
    pixel_variance: f64,
    instructions: Instructions,
}

/// Points and covariances of [`BatchPair`], in the rows of their rays. Rows are NaN where the rays make no point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BatchPoints {
    /// Points: N × 3, millimetres, left frame.
    pub points: Vec<[f64; 3]>,
    /// Covariances: N × 6, mm², left frame, in the order xx, xy, xz, yy, yz, zz.
    pub covariances: Vec<[f64; 6]>,
}

impl BatchPair {
    /// Prepares `pair` for pixel noise of standard deviation `pixel_sigma` in each coordinate of each image, and for
    /// the covariance `shared` of lenses and pose.
    #[must_use]
    pub fn new(pair: &StereoPair<'_>, pixel_sigma: f64, shared: &SharedCovariance) -> Self {
        Self {
            place: Triangulate::new(&pair.left_from_right.origin(), Angle::from_rad(0.0)),
            lenses: [pair.left, pair.right].map(LensSlope::new),
            left_from_right: pair.left_from_right.rotation().to_rotation_matrix().into_inner(),
            shared: std::array::from_fn(|row| std::array::from_fn(|column| shared.matrix()[(row, column)])),
            pixel_variance: pixel_sigma * pixel_sigma,
            instructions: Instructions::Best,
        }
    }

    /// Chooses the processor instructions of later calls.
    #[must_use]
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// Triangulates N pairs of unit rays (N × 3), each in its own camera's frame. Rays beyond the shorter array are
    /// ignored.
    #[must_use]
    pub fn triangulate(&self, left: &[[f64; 3]], right: &[[f64; 3]]) -> BatchPoints {
        let mut out = BatchPoints::default();
        let count = left.len().min(right.len());
        let rays = [&left[..count], &right[..count]];
        match self.instructions {
            Instructions::Best => best(self, rays, &mut out),
            Instructions::Baseline => all::<ALWAYS_FUSED>(self, rays, &mut out),
        }
        out
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn best(pair: &BatchPair, rays: [&[[f64; 3]]; 2], out: &mut BatchPoints) {
    if target_cfg_f!(target_feature = "fma") {
        all::<true>(pair, rays, out);
    } else {
        all::<ALWAYS_FUSED>(pair, rays, out);
    }
}

#[inline(always)]
fn all<const FUSED: bool>(pair: &BatchPair, rays: [&[[f64; 3]]; 2], out: &mut BatchPoints) {
    for_pairs::<FUSED, LANES, 9, 6>(pair, rays, &mut out.points, &mut out.covariances);
}

/// The derivatives of one number by the shared parameters, for each lane.
type Row<const W: usize> = [[f64; W]; SHARED_PARAMETERS];

/// The rays to the point, the normal of their plane, both ranges in millimetres, and one over the sine of the parallax.
struct Geometry<const W: usize> {
    left: Vectors<W>,
    right: Vectors<W>,
    normal: Vectors<W>,
    ranges: [[f64; W]; 2],
    per_sine: [f64; W],
}

impl Kernel<6, 9> for BatchPair {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [ux, uy, uz, vx, vy, vz]: [[f64; W]; 6]) -> [[f64; W]; 9] {
        let [vx, vy, vz] = turned::<FUSED, W>(&self.left_from_right, &[vx, vy, vz]);
        let [x, y, z, ..] = self.place.lanes::<FUSED, W>([ux, uy, uz, vx, vy, vz]);
        let geometry = Geometry::of::<FUSED>(&self.place.t, &[x, y, z]);
        let (rows, pixels) = self.rows::<FUSED, W>(&geometry);
        let [v, u, n] = &rows;
        let weighted = [self.weighted::<FUSED, W>(v), self.weighted::<FUSED, W>(u), self.weighted::<FUSED, W>(n)];
        let mut moved = [[[0.0; W]; 3]; 3];
        for (i, row) in rows.iter().enumerate() {
            for (k, weighted) in weighted.iter().enumerate().skip(i) {
                moved[i][k] = pixels[i][k];
                for (a, b) in row.iter().zip(weighted) {
                    for j in 0..W {
                        moved[i][k][j] = multiply_add::<FUSED>(a[j], b[j], moved[i][k][j]);
                    }
                }
                moved[k][i] = moved[i][k];
            }
        }
        let [xx, xy, xz, yy, yz, zz] = in_space::<FUSED, W>(&moved, &[geometry.right, geometry.left, geometry.normal]);
        [x, y, z, xx, xy, xz, yy, yz, zz]
    }
}

impl BatchPair {
    /// The derivatives of the point along v, u and n by the shared parameters, and their covariance from pixel noise.
    #[inline(always)]
    fn rows<const FUSED: bool, const W: usize>(&self, at: &Geometry<W>) -> ([Row<W>; 3], [[[f64; W]; 3]; 3]) {
        let Geometry { left, right, normal, ranges: [left_range, right_range], per_sine } = at;
        let (mut by_left, mut by_right) = ([0.0; W], [0.0; W]);
        let (mut half_left, mut half_right) = ([0.0; W], [0.0; W]);
        // A shift of the centre by δ acts as a turn of the ray by δ / μ.
        let mut per_right_range = [0.0; W];
        for j in 0..W {
            by_left[j] = left_range[j] * per_sine[j];
            by_right[j] = -right_range[j] * per_sine[j];
            half_left[j] = 0.5 * left_range[j];
            half_right[j] = 0.5 * right_range[j];
            per_right_range[j] = 1.0 / right_range[j];
        }
        let in_plane_left = scaled(&by_left, &cross::<FUSED, W>(normal, left));
        let in_plane_right = scaled(&by_right, &cross::<FUSED, W>(normal, right));
        let (across_left, across_right) = (scaled(&half_left, normal), scaled(&half_right, normal));

        let back = self.left_from_right.transpose();
        let [left_lens, right_lens] = &self.lenses;
        let left_slope = left_lens.at::<FUSED, W>(left);
        let right_slope = right_lens.at::<FUSED, W>(&turned::<FUSED, W>(&back, right));
        let left_rows = [left_slope.along::<FUSED>(&in_plane_left), left_slope.along::<FUSED>(&across_left)];
        let right_rows = [
            right_slope.along::<FUSED>(&turned::<FUSED, W>(&back, &in_plane_right)),
            right_slope.along::<FUSED>(&turned::<FUSED, W>(&back, &across_right)),
        ];

        let mut rows = [[[0.0; W]; SHARED_PARAMETERS]; 3];
        for (row, found) in [(0, &left_rows[0]), (2, &left_rows[1])] {
            rows[row][..LENS_PARAMETERS].copy_from_slice(&found.by_lens);
        }
        for (row, found, gradient) in [(1, &right_rows[0], &in_plane_right), (2, &right_rows[1], &across_right)] {
            rows[row][LENS_PARAMETERS..][..LENS_PARAMETERS].copy_from_slice(&found.by_lens);
            rows[row][2 * LENS_PARAMETERS..][..3].copy_from_slice(&cross::<FUSED, W>(right, gradient));
            rows[row][2 * LENS_PARAMETERS + 3..].copy_from_slice(&scaled(&per_right_range, gradient));
        }
        (rows, self.pixel_noise::<FUSED, W>(&left_rows, &right_rows))
    }

    /// The covariance of the movements along v, u and n from pixel noise. `left` and `right` hold the gradients in the
    /// epipolar plane and across it.
    #[inline(always)]
    fn pixel_noise<const FUSED: bool, const W: usize>(
        &self,
        left: &[Gradient<W>; 2],
        right: &[Gradient<W>; 2],
    ) -> [[[f64; W]; 3]; 3] {
        let mut covariance = [[[0.0; W]; 3]; 3];
        for j in 0..W {
            let product = |a: &Gradient<W>, b: &Gradient<W>| {
                let ([au, av], [bu, bv]) = (&a.by_pixel, &b.by_pixel);
                multiply_add::<FUSED>(au[j], bu[j], av[j] * bv[j]) * self.pixel_variance
            };
            covariance[0][0][j] = product(&left[0], &left[0]);
            covariance[0][2][j] = product(&left[0], &left[1]);
            covariance[1][1][j] = product(&right[0], &right[0]);
            covariance[1][2][j] = product(&right[0], &right[1]);
            covariance[2][2][j] = product(&left[1], &left[1]) + product(&right[1], &right[1]);
        }
        covariance
    }

    /// The shared covariance times `row`.
    #[inline(always)]
    fn weighted<const FUSED: bool, const W: usize>(&self, row: &Row<W>) -> Row<W> {
        let mut out = [[0.0; W]; SHARED_PARAMETERS];
        for (sum, covariances) in out.iter_mut().zip(&self.shared) {
            for (covariance, value) in covariances.iter().zip(row) {
                for j in 0..W {
                    sum[j] = multiply_add::<FUSED>(*covariance, value[j], sum[j]);
                }
            }
        }
        out
    }
}

impl<const W: usize> Geometry<W> {
    #[inline(always)]
    fn of<const FUSED: bool>(t: &Vector3<f64>, point: &Vectors<W>) -> Self {
        let centre = [[t.x; W], [t.y; W], [t.z; W]];
        let mut from_right = *point;
        for (from_right, centre) in from_right.iter_mut().zip(&centre) {
            for j in 0..W {
                from_right[j] -= centre[j];
            }
        }
        let (left, left_range) = unit::<FUSED, W>(point);
        let (right, right_range) = unit::<FUSED, W>(&from_right);
        let (normal, _) = unit::<FUSED, W>(&cross::<FUSED, W>(&centre, point));
        let mut per_sine = dot::<FUSED, W>(&cross::<FUSED, W>(&left, &right), &normal);
        for sine in &mut per_sine {
            *sine = 1.0 / *sine;
        }
        Self { left, right, normal, ranges: [left_range, right_range], per_sine }
    }
}

/// The upper triangle, by rows, of the covariance of a sum of `directions` whose factors have the covariance `moved`.
#[inline(always)]
fn in_space<const FUSED: bool, const W: usize>(
    moved: &[[[f64; W]; 3]; 3],
    directions: &[Vectors<W>; 3],
) -> [[f64; W]; 6] {
    let component = |axis: usize| [directions[0][axis], directions[1][axis], directions[2][axis]];
    let mut out = [[0.0; W]; 6];
    for (out, (row, column)) in out.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
        let (a, b) = (component(row), component(column));
        for (a, moved) in a.iter().zip(moved) {
            let inner = dot::<FUSED, W>(moved, &b);
            for j in 0..W {
                out[j] = multiply_add::<FUSED>(a[j], inner[j], out[j]);
            }
        }
    }
    out
}
