//! Analytic shapes, each about the origin of its own frame, and where rays meet them.

use nalgebra::{Matrix3, Vector3};

use crate::packet::{Singles, Triples, at_ranges, dots};
use crate::real::Real;

/// A contact nearer than this (mm) is taken for the surface that the ray starts from.
pub const NEAREST_MM: f64 = 1e-6;

/// A surface in its own frame, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// The plane z = 0 within `half` of the origin in x and y.
    Rectangle { half: [f64; 2] },
    /// The plane z = 0 within an ellipse of semi-axes `half`, translucent as a leaf: lit alike on both sides.
    Ellipse { half: [f64; 2] },
    /// A box with faces at ± `half`.
    Block { half: Vector3<f64> },
    /// A sphere.
    Sphere { radius: f64 },
    /// A solid cylinder about the y axis, its caps at y = ± `half_height`.
    Cylinder { radius: f64, half_height: f64 },
}

/// Where rays meet a shape.
#[derive(Clone, Copy, Debug)]
pub struct Meetings<const N: usize> {
    /// Distance along each ray in units of its direction's length; infinite where it misses.
    pub ranges: [f64; N],
    /// Which part of the shape is met, where there are several.
    parts: [u64; N],
}

/// Of the parts of a block, the axis of a face; this is added where the ray comes from outside.
const OUTSIDE: u64 = 4;
/// Parts of a cylinder.
const SIDE: u64 = 0;
const LOW_CAP: u64 = 1;
const HIGH_CAP: u64 = 2;

/// Points on a shape, with coordinates for textures.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoints<T, const N: usize> {
    /// In the shape's frame, mm.
    pub position: [[T; N]; 3],
    /// Coordinates in mm along the surface (spheres: the position's x and y).
    pub uv: [[T; N]; 2],
    /// Number of the face of the shape.
    pub face: [u32; N],
    /// Extent of a pixel at the point, mm.
    pub footprint: [T; N],
}

impl Shape {
    /// The nearest contacts ahead of the `origin`s of rays in the frame of the shape.
    #[inline(always)]
    pub fn meet<const N: usize>(&self, origin: &Triples<N>, direction: &Triples<N>) -> Meetings<N> {
        match *self {
            Self::Rectangle { half } => {
                meet_plane(origin, direction, |x, y| (x.abs() <= half[0]) & (y.abs() <= half[1]))
            }
            Self::Ellipse { half } => {
                meet_plane(origin, direction, |x, y| (x / half[0]).powi(2) + (y / half[1]).powi(2) <= 1.0)
            }
            Self::Block { half } => meet_block(origin, direction, half),
            Self::Sphere { radius } => meet_sphere(origin, direction, radius),
            Self::Cylinder { radius, half_height } => meet_cylinder(origin, direction, radius, half_height),
        }
    }

    /// Unit normals out of the solid where it is met; for a rectangle towards the ray's origin, for an ellipse always z.
    #[inline(always)]
    pub fn normals<const N: usize>(
        &self,
        origin: &Triples<N>,
        direction: &Triples<N>,
        met: &Meetings<N>,
    ) -> Triples<N> {
        let mut normals = [[0.0; N]; 3];
        match *self {
            Self::Rectangle { .. } => {
                for i in 0..N {
                    normals[2][i] = -direction[2][i].signum();
                }
            }
            Self::Ellipse { .. } => normals[2] = [1.0; N],
            Self::Block { .. } => {
                for (axis, normals) in normals.iter_mut().enumerate() {
                    for i in 0..N {
                        let sign = direction[axis][i].signum();
                        let sign = if met.parts[i] & OUTSIDE == 0 { sign } else { -sign };
                        normals[i] = if met.parts[i] & (OUTSIDE - 1) == axis as u64 { sign } else { 0.0 };
                    }
                }
            }
            Self::Sphere { radius } => {
                normals = at_ranges(origin, direction, &met.ranges);
                normals.as_flattened_mut().iter_mut().for_each(|component| *component /= radius);
            }
            Self::Cylinder { radius, .. } => {
                let places = at_ranges(origin, direction, &met.ranges);
                for i in 0..N {
                    let on_side = met.parts[i] == SIDE;
                    normals[0][i] = if on_side { places[0][i] / radius } else { 0.0 };
                    normals[2][i] = if on_side { places[2][i] / radius } else { 0.0 };
                    let cap = if met.parts[i] == LOW_CAP { -1.0 } else { 1.0 };
                    normals[1][i] = if on_side { 0.0 } else { cap };
                }
            }
        }
        normals
    }

    /// [`Self::normals`] at `positions` on the surface, by these alone, but for the side of a rectangle that rays of these directions meet.
    #[inline(always)]
    pub fn outward<const N: usize>(&self, positions: &Singles<N>, directions: &Singles<N>) -> Singles<N> {
        let (p, mut normals) = (positions, [[0.0; N]; 3]);
        match *self {
            Self::Rectangle { .. } => {
                for i in 0..N {
                    normals[2][i] = -directions[2][i].signum();
                }
            }
            Self::Ellipse { .. } => normals[2] = [1.0; N],
            Self::Block { half } => {
                let inverse = half.map(|half| half.recip() as f32);
                for i in 0..N {
                    let parts = [p[0][i] * inverse.x, p[1][i] * inverse.y, p[2][i] * inverse.z];
                    let sizes = [parts[0].abs(), parts[1].abs(), parts[2].abs()];
                    let is_x = (sizes[0] >= sizes[1]) & (sizes[0] >= sizes[2]);
                    let is_z = !is_x & (sizes[2] > sizes[1]);
                    normals[0][i] = if is_x { parts[0].signum() } else { 0.0 };
                    normals[1][i] = if is_x | is_z { 0.0 } else { parts[1].signum() };
                    normals[2][i] = if is_z { parts[2].signum() } else { 0.0 };
                }
            }
            Self::Sphere { radius } => {
                let inverse = radius.recip() as f32;
                normals = *p;
                normals.as_flattened_mut().iter_mut().for_each(|component| *component *= inverse);
            }
            Self::Cylinder { radius, half_height } => {
                let (radius, inverse, half_height) = (radius as f32, radius.recip() as f32, half_height as f32);
                for i in 0..N {
                    let [x, y, z] = [p[0][i], p[1][i], p[2][i]];
                    let on_cap = y.abs() - half_height > (x * x + z * z).sqrt() - radius;
                    normals[0][i] = if on_cap { 0.0 } else { x * inverse };
                    normals[1][i] = if on_cap { y.signum() } else { 0.0 };
                    normals[2][i] = if on_cap { 0.0 } else { z * inverse };
                }
            }
        }
        normals
    }

    /// Half the size of the axis-aligned box about the shape after `rotation`.
    pub fn half_extent(&self, rotation: &Matrix3<f64>) -> Vector3<f64> {
        match *self {
            Self::Sphere { radius } => Vector3::repeat(radius),
            _ => rotation.abs() * self.half_size(),
        }
    }

    /// Half the size of the box about the shape in its own frame.
    pub const fn half_size(&self) -> Vector3<f64> {
        match *self {
            Self::Rectangle { half } | Self::Ellipse { half } => Vector3::new(half[0], half[1], 0.0),
            Self::Block { half } => half,
            Self::Sphere { radius } => Vector3::new(radius, radius, radius),
            Self::Cylinder { radius, half_height } => Vector3::new(radius, half_height, radius),
        }
    }

    /// The texture coordinates of `position`s, points on the surface where `normal`s stand out.
    #[inline(always)]
    pub fn surface_points<T: Real, const N: usize>(
        &self,
        position: [[T; N]; 3],
        normal: &[[T; N]; 3],
        footprint: [T; N],
    ) -> SurfacePoints<T, N> {
        let (p, zero) = (&position, T::of(0.0));
        let (mut uv, mut face) = ([p[0], p[1]], [0; N]);
        match *self {
            Self::Rectangle { .. } | Self::Ellipse { .. } => {
                for i in 0..N {
                    face[i] = u32::from(normal[2][i] > zero);
                }
            }
            Self::Sphere { .. } => {
                for i in 0..N {
                    face[i] = u32::from(p[2][i] > zero);
                }
            }
            Self::Block { .. } => {
                for i in 0..N {
                    let sizes = [normal[0][i].abs(), normal[1][i].abs(), normal[2][i].abs()];
                    let (is_x, is_z) = (sizes[0] >= sizes[1].max(sizes[2]), sizes[2] > sizes[1]);
                    let [x, y, z] = [p[0][i], p[1][i], p[2][i]];
                    // Across and along, and the sign of the face.
                    let (u, v, number, side) = if is_x {
                        (z, y, 0, normal[0][i])
                    } else if is_z {
                        (x, y, 4, normal[2][i])
                    } else {
                        (x, z, 2, normal[1][i])
                    };
                    (uv[0][i], uv[1][i]) = (u, v);
                    face[i] = number | u32::from(side > zero);
                }
            }
            Self::Cylinder { radius, .. } => {
                for i in 0..N {
                    let on_cap = normal[1][i].abs() > T::of(0.5);
                    let around = T::of(radius) * p[0][i].atan2(p[2][i]);
                    (uv[0][i], uv[1][i]) = if on_cap { (p[0][i], p[2][i]) } else { (around, p[1][i]) };
                    face[i] = if on_cap { 1 + u32::from(normal[1][i] > zero) } else { 0 };
                }
            }
        }
        SurfacePoints { position, uv, face, footprint }
    }
}

#[inline(always)]
fn meet_plane<const N: usize>(o: &Triples<N>, d: &Triples<N>, inside: impl Fn(f64, f64) -> bool) -> Meetings<N> {
    let mut ranges = [f64::INFINITY; N];
    for i in 0..N {
        let range = -o[2][i] / d[2][i];
        // A ray within the plane divides by zero; it fails this test, infinite or not a number.
        let ahead = (range > NEAREST_MM) & (range < f64::INFINITY);
        let met = ahead & inside(o[0][i] + range * d[0][i], o[1][i] + range * d[1][i]);
        ranges[i] = if met { range } else { f64::INFINITY };
    }
    Meetings { ranges, parts: [0; N] }
}

/// By slabs: T. Kay and J. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986.
#[inline(always)]
fn meet_block<const N: usize>(o: &Triples<N>, d: &Triples<N>, half: Vector3<f64>) -> Meetings<N> {
    let (mut enter, mut leave) = ([f64::NEG_INFINITY; N], [f64::INFINITY; N]);
    let (mut enter_axis, mut leave_axis) = ([0_u64; N], [0_u64; N]);
    for axis in 0..3 {
        for i in 0..N {
            let inverse = 1.0 / d[axis][i];
            let (to_middle, reach) = (-o[axis][i] * inverse, (half[axis] * inverse).abs());
            // Along the slab a ray is inside it from ever to ever, or never.
            let is_along = d[axis][i] == 0.0;
            let beside = if o[axis][i].abs() > half[axis] { f64::INFINITY } else { f64::NEG_INFINITY };
            let near = if is_along { beside } else { to_middle - reach };
            let far = if is_along { f64::INFINITY } else { to_middle + reach };
            enter_axis[i] = if near > enter[i] { axis as u64 } else { enter_axis[i] };
            leave_axis[i] = if far < leave[i] { axis as u64 } else { leave_axis[i] };
            enter[i] = if near > enter[i] { near } else { enter[i] };
            leave[i] = if far < leave[i] { far } else { leave[i] };
        }
    }
    let (mut ranges, mut parts) = ([f64::INFINITY; N], [0; N]);
    for i in 0..N {
        let from_outside = enter[i] > NEAREST_MM;
        let met = (enter[i] <= leave[i]) & (leave[i] > NEAREST_MM);
        let range = if from_outside { enter[i] } else { leave[i] };
        ranges[i] = if met { range } else { f64::INFINITY };
        parts[i] = if from_outside { enter_axis[i] + OUTSIDE } else { leave_axis[i] };
    }
    Meetings { ranges, parts }
}

#[inline(always)]
fn meet_sphere<const N: usize>(o: &Triples<N>, d: &Triples<N>, radius: f64) -> Meetings<N> {
    let (a, b, c) = (dots(d, d), dots(o, d), dots(o, o));
    let mut ranges = [f64::INFINITY; N];
    for i in 0..N {
        ranges[i] = nearest_root(a[i], b[i], c[i] - radius * radius, |_| true);
    }
    Meetings { ranges, parts: [0; N] }
}

#[inline(always)]
fn meet_cylinder<const N: usize>(o: &Triples<N>, d: &Triples<N>, radius: f64, half_height: f64) -> Meetings<N> {
    let (mut ranges, mut parts) = ([f64::INFINITY; N], [SIDE; N]);
    for i in 0..N {
        let ([ox, oy, oz], [dx, dy, dz]) = ([o[0][i], o[1][i], o[2][i]], [d[0][i], d[1][i], d[2][i]]);
        let beside = |range: f64| (oy + range * dy).abs() <= half_height;
        ranges[i] = nearest_root(dx * dx + dz * dz, ox * dx + oz * dz, ox * ox + oz * oz - radius * radius, beside);
        for (part, y) in [(HIGH_CAP, half_height), (LOW_CAP, -half_height)] {
            let range = (y - oy) / dy;
            let (x, z) = (ox + range * dx, oz + range * dz);
            let nearer = (range > NEAREST_MM) & (x * x + z * z <= radius * radius) & (range < ranges[i]);
            ranges[i] = if nearer { range } else { ranges[i] };
            parts[i] = if nearer { part } else { parts[i] };
        }
    }
    Meetings { ranges, parts }
}

/// The least root of a x² + 2 b x + c ahead of the origin that is `valid`; infinite where there is none.
#[inline(always)]
fn nearest_root(a: f64, b: f64, c: f64, valid: impl Fn(f64) -> bool) -> f64 {
    // Of a negative number the root is none, and fails every comparison.
    let root = (b * b - a * c).sqrt();
    let [first, second] = [(-b - root) / a, (-b + root) / a];
    let holds = |range: f64| (a > 0.0) & (range > NEAREST_MM) & valid(range);
    let second = if holds(second) { second } else { f64::INFINITY };
    if holds(first) { first } else { second }
}
