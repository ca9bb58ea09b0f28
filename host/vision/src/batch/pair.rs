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
use nalgebra::{Matrix3, Vector3};

use super::Instructions;
use super::lanes::ALWAYS_FUSED;
use super::pairs::{Rows, for_pairs};
use super::shared_errors::{ByPose, SharedErrors};
use super::slope::LensSlope;
use super::triangulate::Triangulate;
use super::vectors::{cross, dot, turned};
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
            Instructions::Baseline => all::<ALWAYS_FUSED>(self, rays, out),
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
    if target_cfg_f!(target_feature = "fma") {
        all::<true>(pair, rays, out);
    } else {
        all::<ALWAYS_FUSED>(pair, rays, out);
    }
}

#[inline(always)]
fn all<const FUSED: bool>(pair: &BatchPair, rays: [&[[f64; 3]]; 2], out: &mut BatchPoints) {
    for_pairs::<FUSED, ROWS, 6>(pair, rays, &mut out.points, &mut out.covariances);
}

/// Rows per step. The loop over them is so long that the compiler makes vectors of its rounds: shorter ones it unrolls, and then finds half of
/// the arithmetic of the lenses' geometry one row at a time. The loops within a row must be short enough to be unrolled, some 300 instructions
/// each; one that stays a loop keeps all from becoming vectors, and costs three times the time.
const ROWS: usize = 64;

/// A point P, Q = P - t, the unit normal of the epipolar plane, and how far turns of the rays move the point.
struct Geometry {
    point: Vector3<f64>,
    from_right: Vector3<f64>,
    normal: Vector3<f64>,
    /// 1 / λ and 1 / μ, in 1/mm.
    per_range: [f64; 2],
    /// λ² / A and -μ² / A: movement along Q and P per turn in the plane.
    in_plane: [f64; 2],
    /// λ / 2 and μ / 2: movement along the normal, in mm, per turn across the plane.
    across: [f64; 2],
}

impl Rows<ROWS, 6> for BatchPair {
    #[inline(always)]
    fn rows<const FUSED: bool>(
        &self,
        left: &[[f64; 3]; ROWS],
        right: &[[f64; 3]; ROWS],
    ) -> ([[f64; 3]; ROWS], [[f64; 6]; ROWS]) {
        let (mut points, mut covariances) = ([[0.0; 3]; ROWS], [[0.0; 6]; ROWS]);
        for j in 0..ROWS {
            (points[j], covariances[j]) = self.row::<FUSED>(&left[j].into(), &right[j].into());
        }
        (points, covariances)
    }
}

impl BatchPair {
    /// The point of two rays, each in its own camera's frame, and its covariance.
    #[inline(always)]
    fn row<const FUSED: bool>(&self, left: &Vector3<f64>, right: &Vector3<f64>) -> ([f64; 3], [f64; 6]) {
        let at = Geometry::of::<FUSED>(&self.place, left, &turned::<FUSED>(&self.left_from_right, right));
        let [left_lens, right_lens] = &self.lenses;
        let mut left = left_lens.at::<FUSED>(&at.point, at.per_range[0], &at.normal);
        let from_right = turned::<FUSED>(&self.right_from_left, &at.from_right);
        let normal = turned::<FUSED>(&self.right_from_left, &at.normal);
        let mut right = right_lens.at::<FUSED>(&from_right, at.per_range[1], &normal);
        let mut pose = at.turns_by_pose::<FUSED>();
        scale(&mut left.turns, [at.in_plane[0], at.across[0]]);
        scale(&mut right.turns, [at.in_plane[1], at.across[1]]);
        scale(&mut pose, [at.in_plane[1], at.across[1]]);
        let moved = self.shared.moved::<FUSED>(&left, &right, &pose);
        (at.point.into(), in_space::<FUSED>(&moved, [&at.from_right, &at.point, &at.normal]))
    }
}

impl Geometry {
    /// Everything is NaN where the rays make no point.
    #[inline(always)]
    fn of<const FUSED: bool>(place: &Triangulate, u: &Vector3<f64>, v: &Vector3<f64>) -> Self {
        let place = place.place::<FUSED>(u, v);
        let area = place.area_squared.sqrt();
        let (left_range, right_range) = (place.left_squared.sqrt(), place.right_squared.sqrt());
        // The three inverses by one division.
        let per_ranges = 1.0 / (area * (left_range * right_range)) + place.valid;
        let per_area = left_range * right_range * per_ranges;
        Self {
            point: place.point.add_scalar(place.valid),
            from_right: place.from_right,
            normal: place.area * per_area,
            per_range: [area * right_range * per_ranges, area * left_range * per_ranges],
            in_plane: [place.left_squared * per_area, -place.right_squared * per_area],
            across: [0.5 * left_range, 0.5 * right_range],
        }
    }

    /// The turn of the right ray in the epipolar plane, then across it, by the turn and the shift of the right camera.
    #[inline(always)]
    fn turns_by_pose<const FUSED: bool>(&self) -> [ByPose; 2] {
        let per_range = self.per_range[1];
        let (n, w) = (&self.normal, cross::<FUSED>(&self.normal, &self.from_right) * per_range);
        let (d, e) = (w * per_range, n * per_range);
        [[n.x, n.y, n.z, d.x, d.y, d.z], [-w.x, -w.y, -w.z, e.x, e.y, e.z]]
    }
}

/// Multiplies each row by a factor.
#[inline(always)]
fn scale<const N: usize>(rows: &mut [[f64; N]; 2], factors: [f64; 2]) {
    for (row, factor) in rows.iter_mut().zip(factors) {
        for value in row {
            *value *= factor;
        }
    }
}

/// The upper triangle, by rows, of the covariance of a sum of `directions` whose factors have the covariance `moved`, an
/// upper triangle too.
#[inline(always)]
fn in_space<const FUSED: bool>(&[aa, ab, ac, bb, bc, cc]: &[f64; 6], [a, b, c]: [&Vector3<f64>; 3]) -> [f64; 6] {
    let (axis, dot) = (|i: usize| Vector3::new(a[i], b[i], c[i]), dot::<FUSED>);
    let [from_a, from_b, from_c] = [Vector3::new(aa, ab, ac), Vector3::new(ab, bb, bc), Vector3::new(ac, bc, cc)];
    let inner = |i: usize| Vector3::new(dot(&from_a, &axis(i)), dot(&from_b, &axis(i)), dot(&from_c, &axis(i)));
    let [x, y, z] = [inner(0), inner(1), inner(2)];
    [dot(&axis(0), &x), dot(&axis(0), &y), dot(&axis(0), &z), dot(&axis(1), &y), dot(&axis(1), &z), dot(&axis(2), &z)]
}
