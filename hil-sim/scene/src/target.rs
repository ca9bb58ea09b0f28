//! A calibration target, and the plain studio in which images of it are taken.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Frame, Length, Point, Transform, World};

use crate::scene::{Material, Solid};
use crate::shape::Shape;
use crate::texture::{Pattern, Rgb};
use crate::{Scene, Sheet};

/// Reflectances of matte print: paper, toner, and the unprinted back.
pub(crate) const WHITE: Rgb = [0.82, 0.82, 0.80];
pub(crate) const BLACK: Rgb = [0.04, 0.04, 0.04];
pub(crate) const BACK: Rgb = [0.30, 0.28, 0.26];
/// The even grey behind a target alone.
pub(crate) const BACKDROP: Rgb = [0.35; 3];

/// Width of the white border, as a share of the side of a square.
const BORDER: f64 = 0.5;

/// A flat checkerboard of no thickness with a white border of half a square.
///
/// As a type it also names the target's own frame: the origin at inner corner (0, 0), x along the rows, y down the
/// columns, z into the target, so that the printed side is seen from negative z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Inner corners along x.
    pub columns: u32,
    /// Inner corners along y.
    pub rows: u32,
    /// Side of a square.
    pub square: Length,
}

impl Frame for Target {}

impl Target {
    /// The inner corner in `column` and `row`, both counted from 0.
    #[must_use]
    pub fn corner(&self, column: u32, row: u32) -> Point<Self> {
        Point::from_mm(Vector3::new(f64::from(column), f64::from(row), 0.0) * self.square.mm())
    }

    /// The middle of the target.
    #[must_use]
    pub fn centre(&self) -> Point<Self> {
        let middle = Vector3::new(f64::from(self.columns) - 1.0, f64::from(self.rows) - 1.0, 0.0);
        Point::from_mm(middle * (0.5 * self.square.mm()))
    }

    /// The pose of a target turned by `rotation` with its middle at `middle`, in millimetres.
    #[must_use]
    pub fn placed<F: Frame>(&self, rotation: UnitQuaternion<f64>, middle: Vector3<f64>) -> Transform<F, Self> {
        Transform::new(rotation, middle - rotation * self.centre().mm())
    }

    /// Width and height including the border.
    #[must_use]
    pub fn size(&self) -> [Length; 2] {
        [self.columns, self.rows].map(|corners| self.square * (f64::from(corners) + 1.0 + 2.0 * BORDER))
    }

    /// Whether the place, in millimetres about the middle of the target, is black.
    pub(crate) fn is_black(&self, [x, y]: [f64; 2]) -> bool {
        let (columns, rows) = (f64::from(self.columns) + 1.0, f64::from(self.rows) + 1.0);
        let (column, row) = (x / self.square.mm() + 0.5 * columns, y / self.square.mm() + 0.5 * rows);
        let printed = (0.0..columns).contains(&column) && (0.0..rows).contains(&row);
        // The square up and left of corner (0, 0) is black.
        printed && (column as u32 + row as u32).is_multiple_of(2)
    }
}

impl Scene {
    /// A closed, evenly lit cube of 6 m side with mottled grey walls about the world's origin.
    #[must_use]
    pub fn studio() -> Self {
        const HALF_MM: f64 = 3000.0;
        let wall = Pattern::Mottled { light: [0.45, 0.45, 0.45], dark: [0.25, 0.25, 0.26], cell: 300.0 };
        Self::closed(Vector3::repeat(-HALF_MM), Vector3::repeat(HALF_MM), [wall; 6])
    }

    /// A `target` alone in the [studio](Self::studio).
    #[must_use]
    pub fn target_in_studio(target: impl Into<Sheet>, world_from_target: Transform<World, Target>) -> Self {
        Self::studio().with_target(target, world_from_target)
    }

    /// A `target` alone before an even grey, which renders quickest where only the target matters.
    #[must_use]
    pub fn target_alone(target: impl Into<Sheet>, world_from_target: Transform<World, Target>) -> Self {
        Self::empty(BACKDROP).with_target(target, world_from_target)
    }

    /// The scene with a `target` added. The target may intersect other solids.
    #[must_use]
    pub fn with_target(self, target: impl Into<Sheet>, world_from_target: Transform<World, Target>) -> Self {
        let target = target.into();
        let half = target.size().map(|side| 0.5 * side.mm());
        let middle = world_from_target * target.centre();
        let material = Material { pattern: Pattern::Print(target), seed: 0, glow: None };
        self.with(vec![Solid::new(Shape::Rectangle { half }, middle.mm(), world_from_target.rotation(), material)])
    }
}
