//! Triangulation of whole arrays of rays, with the covariance from pixel noise, lenses and pose.
//!
//! The derivation is that of [`crate::PointUncertainty`], written along three directions: a turn of the left ray moves
//! the point along the right ray v, a turn of the right ray moves it along the left ray u, and both move it along the
//! normal n of their plane. With P the point, Q = P - t, λ and μ their lengths and A = |t × P|, a turn in the plane by a
//! radian moves the point by
//!
//! ```text
//! λ v / s = λ² Q / A by the left ray      -μ u / s = -μ² P / A by the right ray      across it: λ n / 2 and μ n / 2
//! ```
//!
//! A turn ω of the right camera turns its ray by n·ω in the plane and by -w·ω across it, with w = n × v; a shift δ turns it by
//! w·δ / μ and by n·δ / μ.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::Matrix3;

use super::Instructions;
use super::lanes::{ALWAYS_FUSED, Kernel};
use super::pairs::{NARROW, WIDE, for_pairs};
use super::shared_errors::{ByPose, SharedErrors};
use super::slope::LensSlope;
use super::triangulate::Triangulate;
use super::vectors::{Vectors, cross, dot, scaled, turned};
use crate::lens_derivatives::{CENTRAL_PARAMETERS, LENS_PARAMETERS};
use crate::{
    Angle, KannalaBrandt, Left, Point, PointUncertainty, Right, SharedCovariance, StereoPair, Transform, UnitRay,
    pseudo_intersection,
};

/// A stereo pair prepared for whole arrays of rays: pseudo-intersections with the covariance of
/// [`crate::PointUncertainty::covariance`], several times faster than one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchPair {
    place: Triangulate,
    lenses: [LensSlope; 2],
    left_from_right: Matrix3<f64>,
    right_from_left: Matrix3<f64>,
    shared: SharedErrors,
    one_by_one: Option<OneByOne>,
    instructions: Instructions,
}

/// A pair of which a lens is not central and symmetric, or not known to be: its points are made one by one.
#[derive(Clone, Debug, PartialEq)]
struct OneByOne {
    lenses: [KannalaBrandt; 2],
    left_from_right: Transform<Left, Right>,
    pixel_sigma: f64,
    shared: SharedCovariance,
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
        let lenses = [pair.left, pair.right];
        let left_from_right = pair.left_from_right.rotation().to_rotation_matrix().into_inner();
        Self {
            place: Triangulate::new(&pair.left_from_right.origin(), Angle::from_rad(0.0)),
            lenses: lenses.map(LensSlope::new),
            left_from_right,
            right_from_left: left_from_right.transpose(),
            shared: SharedErrors::new(lenses, pixel_sigma * pixel_sigma, shared),
            one_by_one: OneByOne::of(pair, pixel_sigma, shared),
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
        self.triangulate_into(left, right, &mut out);
        out
    }

    /// Like [`Self::triangulate`], but appends the results to `out`. In memory that was used before, a large array takes
    /// much less time than in new memory, whose pages the system must clear.
    pub fn triangulate_into(&self, left: &[[f64; 3]], right: &[[f64; 3]], out: &mut BatchPoints) {
        let count = left.len().min(right.len());
        let rays = [&left[..count], &right[..count]];
        if let Some(pair) = &self.one_by_one {
            return rays[0].iter().zip(rays[1]).for_each(|(left, right)| pair.add(left, right, out));
        }
        match self.instructions {
            Instructions::Best => best(self, rays, out),
            Instructions::Baseline => all::<ALWAYS_FUSED, NARROW>(self, rays, out),
        }
    }
}

impl OneByOne {
    fn of(pair: &StereoPair<'_>, pixel_sigma: f64, shared: &SharedCovariance) -> Option<Self> {
        let lenses = [*pair.left, *pair.right];
        let is_known = |parameter: usize| shared.matrix()[(parameter, parameter)] == 0.0;
        let is_plain = lenses.iter().zip([0, LENS_PARAMETERS]).all(|(lens, first)| {
            lens.fits_opencv() && (first + CENTRAL_PARAMETERS..first + LENS_PARAMETERS).all(is_known)
        });
        (!is_plain).then_some(Self { lenses, left_from_right: pair.left_from_right, pixel_sigma, shared: *shared })
    }

    fn add(&self, left: &[f64; 3], right: &[f64; 3], out: &mut BatchPoints) {
        let (point, [xx, xy, xz, _, yy, yz, _, _, zz]) =
            self.point(left, right).unwrap_or(([f64::NAN; 3], [f64::NAN; 9]));
        out.points.push(point);
        out.covariances.push([xx, xy, xz, yy, yz, zz]);
    }

    fn point(&self, left: &[f64; 3], right: &[f64; 3]) -> Option<([f64; 3], [f64; 9])> {
        let [left_lens, right_lens] = &self.lenses;
        let pair = StereoPair { left: left_lens, right: right_lens, left_from_right: self.left_from_right };
        let (left, right) = (UnitRay::new((*left).into())?, UnitRay::new((*right).into())?);
        let (between, origin) = pair.at_origins(&left, &right);
        let turned = between.left_from_right * right;
        let made = pseudo_intersection(&left, &turned, &between.left_from_right.origin()).ok()?;
        let point = Point::from_mm(made.point.mm() + origin.mm());
        let covariance = PointUncertainty::of(&point, &pair, self.pixel_sigma)?.covariance(&self.shared);
        Some((point.mm().into(), covariance.as_slice().try_into().ok()?))
    }
}

impl BatchPoints {
    /// Removes all rows and keeps their memory.
    pub fn clear(&mut self) {
        self.points.clear();
        self.covariances.clear();
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn best(pair: &BatchPair, rays: [&[[f64; 3]]; 2], out: &mut BatchPoints) {
    let (is_wide, is_fused) = (target_cfg_f!(target_feature = "avx512f"), target_cfg_f!(target_feature = "fma"));
    match (is_wide, is_fused) {
        (true, _) => all::<true, WIDE>(pair, rays, out),
        (false, true) => all::<true, NARROW>(pair, rays, out),
        (false, false) => all::<ALWAYS_FUSED, NARROW>(pair, rays, out),
    }
}

#[inline(always)]
fn all<const FUSED: bool, const W: usize>(pair: &BatchPair, rays: [&[[f64; 3]]; 2], out: &mut BatchPoints) {
    for_pairs::<FUSED, W, 9, 6>(pair, rays, &mut out.points, &mut out.covariances);
}

/// A point P per lane, Q = P - t, the unit normal of the epipolar plane, and how far turns of the rays move the point.
struct Geometry<const W: usize> {
    point: Vectors<W>,
    from_right: Vectors<W>,
    normal: Vectors<W>,
    /// 1 / λ and 1 / μ, in 1/mm.
    per_range: [[f64; W]; 2],
    /// λ² / A and -μ² / A: movement along Q and P per turn in the plane.
    in_plane: [[f64; W]; 2],
    /// λ / 2 and μ / 2: movement along the normal, in mm, per turn across the plane.
    across: [[f64; W]; 2],
}

impl Kernel<6, 9> for BatchPair {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [ux, uy, uz, vx, vy, vz]: [[f64; W]; 6]) -> [[f64; W]; 9] {
        let right = turned::<FUSED, W>(&self.left_from_right, &[vx, vy, vz]);
        let at = Geometry::of::<FUSED>(&self.place, &[ux, uy, uz], &right);
        let [left_lens, right_lens] = &self.lenses;
        let mut left = left_lens.at::<FUSED, W>(&at.point, &at.per_range[0], &at.normal);
        let from_right = turned::<FUSED, W>(&self.right_from_left, &at.from_right);
        let normal = turned::<FUSED, W>(&self.right_from_left, &at.normal);
        let mut right = right_lens.at::<FUSED, W>(&from_right, &at.per_range[1], &normal);
        let mut pose = at.turns_by_pose::<FUSED>();
        scale(&mut left.turns, [&at.in_plane[0], &at.across[0]]);
        scale(&mut right.turns, [&at.in_plane[1], &at.across[1]]);
        scale(&mut pose, [&at.in_plane[1], &at.across[1]]);
        let moved = self.shared.moved::<FUSED, W>(&left, &right, &pose);
        let [xx, xy, xz, yy, yz, zz] = in_space::<FUSED, W>(&moved, &[at.from_right, at.point, at.normal]);
        let [x, y, z] = at.point;
        [x, y, z, xx, xy, xz, yy, yz, zz]
    }
}

impl<const W: usize> Geometry<W> {
    /// Everything is NaN where the rays make no point.
    #[inline(always)]
    fn of<const FUSED: bool>(place: &Triangulate, u: &Vectors<W>, v: &Vectors<W>) -> Self {
        let mut out = Self {
            point: [[0.0; W]; 3],
            from_right: [[0.0; W]; 3],
            normal: [[0.0; W]; 3],
            per_range: [[0.0; W]; 2],
            in_plane: [[0.0; W]; 2],
            across: [[0.0; W]; 2],
        };
        for j in 0..W {
            let (u, v) = ([u[0][j], u[1][j], u[2][j]].into(), [v[0][j], v[1][j], v[2][j]].into());
            let place = place.place::<FUSED>(&u, &v);
            let per_area = 1.0 / place.area_squared.sqrt() + place.valid;
            for axis in 0..3 {
                out.point[axis][j] = place.point[axis] + place.valid;
                out.from_right[axis][j] = place.from_right[axis];
                out.normal[axis][j] = place.area[axis] * per_area;
            }
            let (left_range, right_range) = (place.left_squared.sqrt(), place.right_squared.sqrt());
            (out.per_range[0][j], out.per_range[1][j]) = (1.0 / left_range, 1.0 / right_range);
            out.in_plane[0][j] = place.left_squared * per_area;
            out.in_plane[1][j] = -place.right_squared * per_area;
            (out.across[0][j], out.across[1][j]) = (0.5 * left_range, 0.5 * right_range);
        }
        out
    }

    /// The turn of the right ray in the epipolar plane, then across it, by the turn and the shift of the right camera.
    #[inline(always)]
    fn turns_by_pose<const FUSED: bool>(&self) -> [ByPose<W>; 2] {
        let per_range = &self.per_range[1];
        let [nx, ny, nz] = self.normal;
        let [wx, wy, wz] = scaled(per_range, &cross::<FUSED, W>(&self.normal, &self.from_right));
        let [mx, my, mz] = scaled(&[-1.0; W], &[wx, wy, wz]);
        let ([dx, dy, dz], [ex, ey, ez]) = (scaled(per_range, &[wx, wy, wz]), scaled(per_range, &self.normal));
        [[nx, ny, nz, dx, dy, dz], [mx, my, mz, ex, ey, ez]]
    }
}

/// Multiplies each row by a factor.
#[inline(always)]
fn scale<const W: usize, const N: usize>(rows: &mut [[[f64; W]; N]; 2], factors: [&[f64; W]; 2]) {
    for (row, factor) in rows.iter_mut().zip(factors) {
        for value in row {
            for j in 0..W {
                value[j] *= factor[j];
            }
        }
    }
}

/// The upper triangle, by rows, of the covariance of a sum of `directions` whose factors have the covariance `moved`, an
/// upper triangle too.
#[inline(always)]
fn in_space<const FUSED: bool, const W: usize>(
    [aa, ab, ac, bb, bc, cc]: &[[f64; W]; 6],
    [a, b, c]: &[Vectors<W>; 3],
) -> [[f64; W]; 6] {
    let axes = [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]];
    let mut inner = axes;
    for (inner, axis) in inner.iter_mut().zip(&axes) {
        *inner = [
            dot::<FUSED, W>(&[*aa, *ab, *ac], axis),
            dot::<FUSED, W>(&[*ab, *bb, *bc], axis),
            dot::<FUSED, W>(&[*ac, *bc, *cc], axis),
        ];
    }
    let mut out = [[0.0; W]; 6];
    for (out, (row, column)) in out.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
        *out = dot::<FUSED, W>(&axes[row], &inner[column]);
    }
    out
}
