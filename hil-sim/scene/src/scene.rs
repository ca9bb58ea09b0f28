//! A scene: lit solids with materials, and the contacts of rays with them.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use vergence_vision::{Length, Point, UnitRay, World};

use crate::hierarchy::{Bounds, Hierarchy};
use crate::light::{Lamp, Lighting};
use crate::outlook::{Outlook, TurnedBox};
use crate::shape::{Contact, Shape};
use crate::texture::{Pattern, Rgb};

/// Added to the radius of the sphere about a shape: far more than double precision loses over a room.
const REACH_MARGIN_MM: f64 = 1e-3;

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
    shape: Shape,
    centre: Vector3<f64>,
    world_from_shape: Matrix3<f64>,
    shape_from_world: Matrix3<f64>,
    /// Square of the radius of the sphere about the shape, mm², with a little more than rounding takes.
    reach_squared: f64,
    material: Material,
}

/// Solids and the light on them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    solids: Vec<Solid>,
    hierarchy: Hierarchy,
    lighting: Lighting,
    /// What may shade places from each lamp.
    shades: Vec<Outlook>,
    /// The background between and beyond the solids.
    backdrop: Rgb,
}

/// Number of a surface in its scene. The same scene gives the same numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SurfaceId(usize);

/// The first contact of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, to rounding error.
    pub range: Length,
    /// Linear red, green and blue radiance at unit exposure, as seen from near.
    pub colour: [f32; 3],
    /// The surface met.
    pub surface: SurfaceId,
}

/// The first contact of a ray, before it is given a colour.
#[derive(Clone, Copy, Debug)]
pub struct Encounter {
    surface: usize,
    contact: Contact,
}

impl Scene {
    /// Casts a ray from `origin`. `None` if it meets nothing, which inside a closed room does not happen.
    ///
    /// The colour of a place does not depend on the direction from which it is seen, except that a flat sheet has two
    /// sides.
    #[must_use]
    pub fn cast(&self, origin: &Point<World>, direction: &UnitRay<World>) -> Option<Hit> {
        let (origin, direction) = (origin.mm(), direction.vector());
        let encounter = self.encounter(origin, direction)?;
        Some(Hit {
            range: Length::from_mm(encounter.range()),
            colour: self.radiance(origin, direction, &encounter, 0.0),
            surface: SurfaceId(encounter.surface),
        })
    }

    /// Distance of the first surface along a ray: [`Self::cast`] without the colour, which takes most of its time.
    #[must_use]
    pub fn reach(&self, origin: &Point<World>, direction: &UnitRay<World>) -> Option<Length> {
        self.encounter(origin.mm(), direction.vector()).map(|encounter| Length::from_mm(encounter.range()))
    }

    /// The first surface on the ray from `origin` along the unit vector `direction`, both in the world.
    pub(crate) fn encounter(&self, origin: Vector3<f64>, direction: Vector3<f64>) -> Option<Encounter> {
        let mut first: Option<Encounter> = None;
        self.hierarchy.visit(origin, direction, f64::INFINITY, |surface, limit| {
            let contact = self.solids[surface].meet(origin, direction, limit)?;
            first = Some(Encounter { surface, contact });
            Some(contact.range)
        });
        first
    }

    /// What rays from within `slack` mm of `place` may meet.
    pub(crate) fn outlook(&self, place: Vector3<f64>, slack: f64) -> Outlook {
        Outlook::new(self.solids.iter().map(Solid::turned_box).enumerate(), place, slack)
    }

    /// The same as [`Self::encounter`], sooner for a ray from a place of this outlook.
    pub(crate) fn encounter_from(
        &self,
        outlook: &Outlook,
        origin: Vector3<f64>,
        direction: Vector3<f64>,
    ) -> Option<Encounter> {
        if !outlook.holds(&origin) {
            return self.encounter(origin, direction);
        }
        let (mut first, mut limit): (Option<Encounter>, _) = (None, f64::INFINITY);
        for candidate in outlook.along(&direction) {
            if f64::from(candidate.from_mm) > limit {
                break;
            }
            let surface = candidate.shape as usize;
            if let Some(contact) = self.solids[surface].meet(origin, direction, limit) {
                limit = contact.range;
                first = Some(Encounter { surface, contact });
            }
        }
        first
    }

    /// The light along a ray with this first encounter.
    pub(crate) fn light(
        &self,
        origin: Vector3<f64>,
        direction: Vector3<f64>,
        met: Option<&Encounter>,
        spread: f64,
    ) -> Rgb {
        met.map_or(self.backdrop, |met| self.radiance(origin, direction, met, spread))
    }

    /// The linear colour of an encounter, of detail no finer than `spread` (radians between neighbouring rays) shows.
    pub(crate) fn radiance(
        &self,
        origin: Vector3<f64>,
        direction: Vector3<f64>,
        encounter: &Encounter,
        spread: f64,
    ) -> Rgb {
        // Texture seen at a slant is compressed; more than this factor would blur it across as well.
        const MOST_SLANTED: f64 = 0.4;
        let solid = &self.solids[encounter.surface];
        let point = origin + direction * encounter.range();
        let normal = solid.world_from_shape * encounter.contact.normal;
        let slant = normal.dot(&direction).abs().max(MOST_SLANTED);
        let position = solid.shape_from_world * (point - solid.centre);
        let at = solid.shape.surface_point(position, encounter.contact.normal, encounter.range() * spread / slant);
        let reflectance = solid.material.pattern.reflectance(&at, solid.material.seed);
        if let Some(glow) = solid.material.glow {
            return reflectance.map(|c| c * glow);
        }
        let light = self.lighting.irradiance(point, normal, |lamp| self.sees(point, normal, lamp));
        std::array::from_fn(|i| reflectance[i] * light[i])
    }

    /// Whether nothing stands between `point`, on a surface with `normal`, and the lamp of this number.
    fn sees(&self, point: Vector3<f64>, normal: Vector3<f64>, lamp: usize) -> bool {
        const CLEARANCE_MM: f64 = 1e-3;
        let start = point + normal * CLEARANCE_MM;
        let to_lamp = self.lighting.lamps[lamp].position - start;
        let distance = to_lamp.norm();
        let candidates = self.shades[lamp].along(&-to_lamp).iter();
        let mut nearer = candidates.take_while(|candidate| f64::from(candidate.from_mm) <= distance);
        !nearer.any(|candidate| self.solids[candidate.shape as usize].meet(start, to_lamp, 1.0).is_some())
    }

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
        Self { solids: Vec::new(), hierarchy: Hierarchy::default(), lighting, shades: Vec::new(), backdrop }
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
        let shades = |lamp: &Lamp| {
            let dark = self.solids.iter().enumerate().filter(|(_, solid)| solid.material.glow.is_none());
            Outlook::new(dark.map(|(number, solid)| (number, solid.turned_box())), lamp.position, 0.0)
        };
        self.shades = self.lighting.lamps.iter().map(shades).collect();
        self
    }
}

impl Solid {
    /// `shape` turned by `rotation` with its origin at `centre`, both in the world, mm.
    pub fn new(shape: Shape, centre: Vector3<f64>, rotation: UnitQuaternion<f64>, material: Material) -> Self {
        let world_from_shape = rotation.to_rotation_matrix().into_inner();
        let shape_from_world = world_from_shape.transpose();
        let reach_squared = (shape.half_size().norm() + REACH_MARGIN_MM).powi(2);
        Self { shape, centre, world_from_shape, shape_from_world, reach_squared, material }
    }

    fn bounds(&self) -> Bounds {
        Bounds::new(self.centre, self.shape.half_extent(&self.world_from_shape))
    }

    fn turned_box(&self) -> TurnedBox {
        TurnedBox { centre: self.centre, world_from_box: self.world_from_shape, half: self.shape.half_size() }
    }

    fn meet(&self, origin: Vector3<f64>, direction: Vector3<f64>, limit: f64) -> Option<Contact> {
        // A line that passes the sphere about the shape misses it.
        let from_centre = origin - self.centre;
        let (along, length) = (from_centre.dot(&direction), direction.norm_squared());
        if from_centre.norm_squared() * length - along * along > self.reach_squared * length {
            return None;
        }
        self.shape.meet(self.shape_from_world * from_centre, self.shape_from_world * direction, limit)
    }
}

impl Encounter {
    /// Number of the surface.
    pub const fn surface(&self) -> usize {
        self.surface
    }

    /// Distance along the ray, mm.
    pub fn range(&self) -> f64 {
        self.contact.range
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn the_hierarchy_finds_what_trying_every_solid_finds() {
        let room = Scene::room();
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| random.random_range(-reach..reach));
        for _ in 0..20_000 {
            let (origin, direction) = (vector(450.0), vector(1.0).normalize());
            let meetings = room.solids.iter().filter_map(|solid| solid.meet(origin, direction, f64::INFINITY));
            let nearest = meetings.map(|contact| contact.range).fold(f64::INFINITY, f64::min);
            let found = room.encounter(origin, direction).map_or(f64::INFINITY, |met| met.range());
            assert_eq!(found.to_bits(), nearest.to_bits(), "{origin} {direction}: {found} is not {nearest}");
        }
    }
}
