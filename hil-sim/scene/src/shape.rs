//! Analytic shapes, each about the origin of its own frame, and where rays meet them.

use nalgebra::{Matrix3, Vector3};

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

/// The contact of a ray with a shape, in the frame of the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Distance along the ray in units of its direction's length.
    pub range: f64,
    /// Unit normal out of the solid; for a rectangle towards the ray's origin, for an ellipse always z.
    pub normal: Vector3<f64>,
}

/// A point on a shape, with coordinates for textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// In the shape's frame, mm.
    pub position: Vector3<f64>,
    /// Coordinates in mm along the surface (spheres: the position's x and y).
    pub uv: [f64; 2],
    /// Number of the face of the shape.
    pub face: u32,
    /// Extent of a pixel at the point, mm.
    pub footprint: f64,
}

impl Shape {
    /// The nearest contact ahead of `origin`, short of `limit`.
    pub fn meet(&self, origin: Vector3<f64>, direction: Vector3<f64>, limit: f64) -> Option<Contact> {
        let contact = match *self {
            Self::Rectangle { half } => meet_plane(origin, direction, |x, y| x.abs() <= half[0] && y.abs() <= half[1])?,
            Self::Ellipse { half } => {
                let inside = |x: f64, y: f64| (x / half[0]).powi(2) + (y / half[1]).powi(2) <= 1.0;
                Contact { normal: Vector3::z(), ..meet_plane(origin, direction, inside)? }
            }
            Self::Block { half } => meet_block(origin, direction, half)?,
            Self::Sphere { radius } => meet_sphere(origin, direction, radius)?,
            Self::Cylinder { radius, half_height } => meet_cylinder(origin, direction, radius, half_height)?,
        };
        (contact.range < limit).then_some(contact)
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

    /// The texture coordinates of `position`, a point on the surface where `normal` stands out.
    pub fn surface_point(&self, position: Vector3<f64>, normal: Vector3<f64>, footprint: f64) -> SurfacePoint {
        let p = position;
        let (uv, face) = match *self {
            Self::Rectangle { .. } | Self::Ellipse { .. } => ([p.x, p.y], u32::from(normal.z > 0.0)),
            Self::Block { .. } => {
                let axis = normal.iamax();
                let uv = [[p.z, p.y], [p.x, p.z], [p.x, p.y]];
                (uv[axis], 2 * axis as u32 + u32::from(normal[axis] > 0.0))
            }
            Self::Sphere { .. } => ([p.x, p.y], u32::from(p.z > 0.0)),
            Self::Cylinder { .. } if normal.y.abs() > 0.5 => ([p.x, p.z], 1 + u32::from(normal.y > 0.0)),
            Self::Cylinder { radius, .. } => ([radius * p.x.atan2(p.z), p.y], 0),
        };
        SurfacePoint { position, uv, face, footprint }
    }
}

fn meet_plane(o: Vector3<f64>, d: Vector3<f64>, inside: impl Fn(f64, f64) -> bool) -> Option<Contact> {
    let range = -o.z / d.z;
    // A ray within the plane divides by zero; it fails this test, infinite or not a number.
    let met = range > NEAREST_MM && range < f64::INFINITY && inside(o.x + range * d.x, o.y + range * d.y);
    met.then(|| Contact { range, normal: Vector3::new(0.0, 0.0, -d.z.signum()) })
}

/// By slabs: T. Kay and J. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986.
fn meet_block(o: Vector3<f64>, d: Vector3<f64>, half: Vector3<f64>) -> Option<Contact> {
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        if d[axis] == 0.0 {
            if o[axis].abs() > half[axis] {
                return None;
            }
            continue;
        }
        let to_middle = -o[axis] / d[axis];
        let reach = (half[axis] / d[axis]).abs();
        if to_middle - reach > enter.0 {
            enter = (to_middle - reach, axis);
        }
        if to_middle + reach < leave.0 {
            leave = (to_middle + reach, axis);
        }
    }
    if enter.0 > leave.0 || leave.0 <= NEAREST_MM {
        return None;
    }
    let (outside, (range, axis)) = if enter.0 > NEAREST_MM { (true, enter) } else { (false, leave) };
    let mut normal = Vector3::zeros();
    normal[axis] = if outside { -d[axis].signum() } else { d[axis].signum() };
    Some(Contact { range, normal })
}

fn meet_sphere(o: Vector3<f64>, d: Vector3<f64>, radius: f64) -> Option<Contact> {
    let range = nearest_root(d.norm_squared(), o.dot(&d), o.norm_squared() - radius * radius, |_| true)?;
    Some(Contact { range, normal: (o + d * range) / radius })
}

fn meet_cylinder(o: Vector3<f64>, d: Vector3<f64>, radius: f64, half_height: f64) -> Option<Contact> {
    let side =
        nearest_root(d.x * d.x + d.z * d.z, o.x * d.x + o.z * d.z, o.x * o.x + o.z * o.z - radius * radius, |range| {
            (o.y + range * d.y).abs() <= half_height
        })
        .map(|range| Contact { range, normal: Vector3::new(o.x + range * d.x, 0.0, o.z + range * d.z) / radius });
    let cap = |y: f64| {
        let range = (y - o.y) / d.y;
        let (x, z) = (o.x + range * d.x, o.z + range * d.z);
        let inside = range > NEAREST_MM && x * x + z * z <= radius * radius;
        inside.then_some(Contact { range, normal: Vector3::new(0.0, y.signum(), 0.0) })
    };
    [side, cap(half_height), cap(-half_height)].into_iter().flatten().min_by(|a, b| a.range.total_cmp(&b.range))
}

/// The least root of a x² + 2 b x + c ahead of the origin that is `valid`.
fn nearest_root(a: f64, b: f64, c: f64, valid: impl Fn(f64) -> bool) -> Option<f64> {
    let discriminant = b * b - a * c;
    if discriminant.is_nan() || discriminant < 0.0 || a <= 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    [(-b - root) / a, (-b + root) / a].into_iter().find(|&x| x > NEAREST_MM && valid(x))
}
