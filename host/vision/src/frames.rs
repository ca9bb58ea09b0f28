//! Points, rays and rigid transforms typed by their coordinate frame.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::Angle;

/// A coordinate frame, as a type. Frames are right-handed; cameras have x right, y down, z along the optical axis.
pub trait Frame: Copy + Debug + PartialEq + Send + Sync {}

macro_rules! frames {
    ($($(#[$doc:meta])* $name:ident),+ $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name;
        impl Frame for $name {}
    )+};
}
frames!(
    /// The frame of the left camera, the reference frame of every pair and cloud.
    Left,
    /// The frame of the right camera.
    Right,
    /// The frame of any one camera, where it does not matter which.
    Camera,
    /// The frame of the rig's fixed part.
    Base,
    /// The frame of the surroundings.
    World,
    /// The frame of a virtual camera at the place of a real one.
    Virtual,
);

/// A point in frame `F`, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<F: Frame> {
    mm: Vector3<f64>,
    frame: PhantomData<F>,
}

/// A direction in frame `F`: a unit vector with any sign of z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitRay<F: Frame> {
    direction: Unit<Vector3<f64>>,
    frame: PhantomData<F>,
}

/// A rigid transform that maps coordinates in frame `From` to coordinates in frame `To`, in millimetres.
///
/// Values are named after both frames, as in `left_from_right`, so that equal frames meet in a product:
///
/// ```
/// # use nalgebra::{UnitQuaternion, Vector3};
/// # use vergence_vision::{Left, Point, Right, Transform};
/// // The right camera stands 145 mm to the right of the left one and looks the same way.
/// let left_from_right = Transform::<Left, Right>::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0));
/// let in_right = Point::<Right>::from_mm(Vector3::new(0.0, 0.0, 500.0));
/// let in_left: Point<Left> = left_from_right * in_right;
/// assert_eq!(in_left.mm(), Vector3::new(145.0, 0.0, 500.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform<To: Frame, From: Frame> {
    isometry: Isometry3<f64>,
    frames: PhantomData<(To, From)>,
}

impl<F: Frame> Point<F> {
    /// Makes a point from its coordinates in millimetres.
    #[must_use]
    pub const fn from_mm(mm: Vector3<f64>) -> Self {
        Self { mm, frame: PhantomData }
    }

    /// The coordinates in millimetres.
    #[must_use]
    pub const fn mm(&self) -> Vector3<f64> {
        self.mm
    }

    /// The direction from the frame's origin; `None` at the origin itself.
    #[must_use]
    pub fn direction(&self) -> Option<UnitRay<F>> {
        UnitRay::new(self.mm)
    }
}

impl<F: Frame> UnitRay<F> {
    /// Makes a ray along `vector` of any length; `None` for a vector that is zero or not finite.
    #[must_use]
    pub fn new(vector: Vector3<f64>) -> Option<Self> {
        // Dividing by the largest component first keeps the squares of very long and very short vectors in range.
        Unit::try_new(vector / vector.amax(), 0.0)
            .filter(|unit| unit.iter().all(|c| c.is_finite()))
            .map(|direction| Self { direction, frame: PhantomData })
    }

    /// The unit vector.
    #[must_use]
    pub fn vector(&self) -> Vector3<f64> {
        self.direction.into_inner()
    }

    /// The angle to the optical axis (z), from 0° to 180°.
    #[must_use]
    pub fn angle_to_axis(&self) -> Angle {
        Angle::from_rad(self.direction.x.hypot(self.direction.y).atan2(self.direction.z))
    }

    /// The point on the ray at `range_mm` millimetres from the origin.
    #[must_use]
    pub fn at(&self, range_mm: f64) -> Point<F> {
        Point::from_mm(self.vector() * range_mm)
    }

    /// Returns the same coordinates typed by another frame with the same axes, such as `Camera` to `Left`.
    #[must_use]
    pub fn renamed<G: Frame>(&self) -> UnitRay<G> {
        UnitRay { direction: self.direction, frame: PhantomData }
    }
}

impl<To: Frame, From: Frame> Transform<To, From> {
    /// Makes a transform from its rotation and the origin of `From` in `To`, in millimetres.
    #[must_use]
    pub fn new(rotation: UnitQuaternion<f64>, origin_mm: Vector3<f64>) -> Self {
        Self::from_isometry(Isometry3::from_parts(Translation3::from(origin_mm), rotation))
    }

    /// Makes a transform from an isometry whose translation is in millimetres.
    #[must_use]
    pub const fn from_isometry(isometry: Isometry3<f64>) -> Self {
        Self { isometry, frames: PhantomData }
    }

    /// The isometry, with its translation in millimetres.
    #[must_use]
    pub const fn isometry(&self) -> &Isometry3<f64> {
        &self.isometry
    }

    /// The origin of `From` in `To`.
    #[must_use]
    pub fn origin(&self) -> Point<To> {
        Point::from_mm(self.isometry.translation.vector)
    }

    /// The rotation part.
    #[must_use]
    pub const fn rotation(&self) -> UnitQuaternion<f64> {
        self.isometry.rotation
    }

    /// The inverse transform: `left_from_right.inverse()` is `right_from_left`.
    #[must_use]
    pub fn inverse(&self) -> Transform<From, To> {
        Transform::from_isometry(self.isometry.inverse())
    }

    /// Returns the same transform typed by other frames.
    #[must_use]
    pub fn renamed<A: Frame, B: Frame>(&self) -> Transform<A, B> {
        Transform::from_isometry(self.isometry)
    }
}

impl<A: Frame, B: Frame, C: Frame> Mul<Transform<B, C>> for Transform<A, B> {
    type Output = Transform<A, C>;
    fn mul(self, right: Transform<B, C>) -> Self::Output {
        Transform::from_isometry(self.isometry * right.isometry)
    }
}

impl<To: Frame, From: Frame> Mul<Point<From>> for Transform<To, From> {
    type Output = Point<To>;
    fn mul(self, point: Point<From>) -> Point<To> {
        Point::from_mm((self.isometry * Point3::from(point.mm)).coords)
    }
}

impl<To: Frame, From: Frame> Mul<UnitRay<From>> for Transform<To, From> {
    type Output = UnitRay<To>;
    fn mul(self, ray: UnitRay<From>) -> UnitRay<To> {
        UnitRay { direction: self.isometry.rotation * ray.direction, frame: PhantomData }
    }
}

/// One camera of a pair, as a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left camera.
    Left,
    /// The right camera.
    Right,
}

impl Side {
    /// The other camera.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// Index in arrays of two: 0 for left, 1 for right.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}
