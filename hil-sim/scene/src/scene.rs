//! A scene: lit solids with materials. [`crate::trace`] follows rays in it.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::hierarchy::{Bounds, Hierarchy};
use crate::light::{Lamp, Lighting};
use crate::outlook::{Outlook, TurnedBox};
use crate::shape::Shape;
use crate::sight::Sight;
use crate::texture::{Pattern, Rgb};

/// The material of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// The kind of surface.
    pub pattern: Pattern,
    /// The variant of that kind.
    pub seed: u32,
    /// Radiance, in place of reflectance, of a surface that shines by itself; such a surface casts no shadow.
    pub glow: Option<f32>,
}

/// A shape with its pose and material.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    pub(crate) shape: Shape,
    pub(crate) centre: Vector3<f64>,
    pub(crate) world_from_shape: Matrix3<f64>,
    pub(crate) shape_from_world: Matrix3<f64>,
    pub(crate) material: Material,
}

/// Solids and the light on them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    pub(crate) solids: Vec<Solid>,
    pub(crate) hierarchy: Hierarchy,
    pub(crate) lighting: Lighting,
    /// What may shade places from each lamp.
    pub(crate) shades: Vec<Outlook>,
    /// The same for many places on one surface.
    pub(crate) quick_shades: Vec<Sight>,
    /// The background between and beyond the solids.
    pub(crate) backdrop: Rgb,
}

impl Scene {
    /// A room from corner `low` to corner `high` with walls, in order: left, right, ceiling, floor, back, front. The
    /// light is even: each surface is as bright as its reflectance.
    pub(crate) fn closed(low: Vector3<f64>, high: Vector3<f64>, walls: [Pattern; 6]) -> Self {
        // The walls overlap at the edges, so that no ray slips out between them.
        const OVERLAP_MM: f64 = 10.0;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let reach = half.add_scalar(OVERLAP_MM);
        let quarter = std::f64::consts::FRAC_PI_2;
        let wall = |side: usize, pattern: Pattern| {
            let axis = side / 2;
            let mut centre = middle;
            centre[axis] = if side.is_multiple_of(2) { low[axis] } else { high[axis] };
            let (half, rotation) = match axis {
                0 => ([reach.z, reach.y], UnitQuaternion::from_axis_angle(&Vector3::y_axis(), quarter)),
                1 => ([reach.x, reach.z], UnitQuaternion::from_axis_angle(&Vector3::x_axis(), quarter)),
                _ => ([reach.x, reach.y], UnitQuaternion::identity()),
            };
            Solid::new(Shape::Rectangle { half }, centre, rotation, Material { pattern, seed: side as u32, glow: None })
        };
        let solids = walls.into_iter().enumerate().map(|(side, pattern)| wall(side, pattern)).collect();
        Self::empty([0.0; 3]).lit(|lighting| lighting.room = [low, high]).with(solids)
    }

    /// An empty scene in even light, before a `backdrop` at infinity.
    pub(crate) fn empty(backdrop: Rgb) -> Self {
        let room = [Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY)];
        let lighting = Lighting { ambient: [1.0; 3], from_above: 0.0, occlusion: 0.0, room, lamps: Vec::new() };
        Self {
            solids: Vec::new(),
            hierarchy: Hierarchy::default(),
            lighting,
            shades: Vec::new(),
            quick_shades: Vec::new(),
            backdrop,
        }
    }

    /// The scene with more solids.
    pub(crate) fn with(mut self, solids: Vec<Solid>) -> Self {
        self.solids.extend(solids);
        let bounds: Vec<Bounds> = self.solids.iter().map(Solid::bounds).collect();
        self.hierarchy = Hierarchy::new(&bounds);
        self.shaded()
    }

    /// The scene in another light.
    pub(crate) fn lit(mut self, relight: impl FnOnce(&mut Lighting)) -> Self {
        relight(&mut self.lighting);
        self.shaded()
    }

    /// The scene with its shades as of its solids and lamps.
    fn shaded(mut self) -> Self {
        let dark = || {
            let dark = self.solids.iter().enumerate().filter(|(_, solid)| solid.material.glow.is_none());
            dark.map(|(number, solid)| (number, solid.turned_box()))
        };
        let lamps = &self.lighting.lamps;
        self.shades = lamps.iter().map(|lamp| Outlook::new(dark(), lamp.position, 0.0)).collect();
        let quick =
            |lamp: &Lamp| Sight::new(&self.solids, Outlook::overlapping(dark(), lamp.position, 0.0, Sight::OVERLAP));
        self.quick_shades = lamps.iter().map(quick).collect();
        self
    }
}

impl Solid {
    /// `shape` turned by `rotation` with its origin at `centre`, both in the world, mm.
    pub fn new(shape: Shape, centre: Vector3<f64>, rotation: UnitQuaternion<f64>, material: Material) -> Self {
        let world_from_shape = rotation.to_rotation_matrix().into_inner();
        let shape_from_world = world_from_shape.transpose();
        Self { shape, centre, world_from_shape, shape_from_world, material }
    }

    fn bounds(&self) -> Bounds {
        Bounds::new(self.centre, self.shape.half_extent(&self.world_from_shape))
    }

    pub fn turned_box(&self) -> TurnedBox {
        TurnedBox { centre: self.centre, world_from_box: self.world_from_shape, half: self.shape.half_size() }
    }
}
