//! What rays meet first, and the light that comes along them: one by one, or as many at once as vector registers hold.

use multiversion::multiversion;
use nalgebra::Vector3;
use vergence_vision::{Length, Point, UnitRay, World};

use crate::Scene;
use crate::outlook::Outlook;
use crate::packet::{LANES, Packet, Triples, alone, at_ranges, largest, less, next_value, one_of, singles, turned};
use crate::radiance::Contacts;
use crate::scene::Solid;
use crate::sight::Sight;
use crate::texture::Rgb;

/// In place of a surface's number where nothing is met.
pub const NOTHING: u32 = u32::MAX;

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

/// The first contacts of rays, before they are given a colour.
#[derive(Clone, Copy, Debug)]
pub struct Encounters<const N: usize> {
    /// Numbers of the surfaces, or [`NOTHING`].
    pub surfaces: [u32; N],
    /// Distances along the rays; infinite where nothing is met.
    pub ranges: [f64; N],
    /// Normals in the frames of the shapes.
    normals: Triples<N>,
}

impl<const N: usize> Encounters<N> {
    const NONE: Self = Self { surfaces: [NOTHING; N], ranges: [f64::INFINITY; N], normals: [[0.0; N]; 3] };
}

/// [`Scene::encounters`] of many rays, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn meet_many(scene: &Scene, outlook: &Outlook, rays: &Packet<f64, LANES>) -> Encounters<LANES> {
    scene.encounters(outlook, rays)
}

/// [`Scene::lights`] of many rays, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn light_many(
    scene: &Scene,
    rays: &Packet<f64, LANES>,
    met: &Encounters<LANES>,
    spreads: &[f64; LANES],
) -> [Rgb; LANES] {
    scene.lights(rays, met, spreads)
}

impl Scene {
    /// Casts a ray from `origin`. `None` if it meets nothing, which inside a closed room does not happen.
    ///
    /// The colour of a place does not depend on the direction from which it is seen, except that a flat sheet has two
    /// sides.
    #[must_use]
    pub fn cast(&self, origin: &Point<World>, direction: &UnitRay<World>) -> Option<Hit> {
        let (ray, met) = self.encounter(origin.mm(), direction.vector())?;
        let [colour] = self.lights(&ray, &met, &[0.0]);
        Some(Hit { range: Length::from_mm(met.ranges[0]), colour, surface: SurfaceId(met.surfaces[0] as usize) })
    }

    /// Distance of the first surface along a ray: [`Self::cast`] without the colour, which takes most of its time.
    #[must_use]
    pub fn reach(&self, origin: &Point<World>, direction: &UnitRay<World>) -> Option<Length> {
        self.encounter(origin.mm(), direction.vector()).map(|(_, met)| Length::from_mm(met.ranges[0]))
    }

    /// The first surface on the ray from `origin` along the unit vector `direction`, both in the world.
    fn encounter(&self, origin: Vector3<f64>, direction: Vector3<f64>) -> Option<(Packet<f64, 1>, Encounters<1>)> {
        let ray = Packet { origin: alone(&origin), direction: alone(&direction), counts: [true] };
        let mut first = Encounters::NONE;
        self.hierarchy.visit(origin, direction, f64::INFINITY, |surface, _| {
            self.solids[surface].take(surface as u32, &ray, &mut first);
            Some(first.ranges[0])
        });
        (first.surfaces[0] != NOTHING).then_some((ray, first))
    }

    /// What rays from within `slack` mm of `place` may meet.
    pub(crate) fn outlook(&self, place: Vector3<f64>, slack: f64) -> Outlook {
        Outlook::new(self.solids.iter().map(Solid::turned_box).enumerate(), place, slack)
    }

    /// The first surfaces on `rays`, most of which start where `outlook` is from.
    #[inline(always)]
    fn encounters<const N: usize>(&self, outlook: &Outlook, rays: &Packet<f64, N>) -> Encounters<N> {
        let mut first = Encounters::NONE;
        let mut inside = *rays;
        for i in (0..N).filter(|&i| rays.counts[i]) {
            let origin = one_of(&rays.origin, i);
            inside.counts[i] = outlook.holds(&origin);
            if inside.counts[i] {
                continue;
            }
            if let Some((_, met)) = self.encounter(origin, one_of(&rays.direction, i)) {
                (first.surfaces[i], first.ranges[i]) = (met.surfaces[0], met.ranges[0]);
                (0..3).for_each(|axis| first.normals[axis][i] = met.normals[axis][0]);
            }
        }
        let cells = outlook.cells(&singles(&rays.direction));
        // What stands in the cell of one ray alone, the others miss.
        let mut candidates = outlook.candidates(&inside.counts, &cells);
        while let Some(candidate) = candidates.next() {
            if f64::from(candidate.from_mm) > largest(&first.ranges, &inside.counts, f64::NEG_INFINITY) {
                break;
            }
            self.solids[candidate.shape as usize].take(candidate.shape, &inside, &mut first);
        }
        first
    }

    /// The light along rays with these first encounters, of detail no finer than the `spreads` (radians between neighbouring rays) show.
    #[inline(always)]
    fn lights<const N: usize>(&self, rays: &Packet<f64, N>, met: &Encounters<N>, spreads: &[f64; N]) -> [Rgb; N] {
        let mut lights = [self.backdrop; N];
        let mut left = rays.counts;
        for (left, surface) in left.iter_mut().zip(&met.surfaces) {
            *left &= *surface != NOTHING;
        }
        while let Some((surface, members)) = next_value(&mut left, &met.surfaces) {
            let solid = &self.solids[surface as usize];
            let points = at_ranges(&rays.origin, &rays.direction, &met.ranges);
            let positions = turned(&solid.shape_from_world, &less(&points, &solid.centre));
            let (rays, ranges, normals) = (&Packet { counts: members, ..*rays }, &met.ranges, met.normals);
            let found = self.radiances(surface, &Contacts { rays, ranges, points, positions, normals }, spreads);
            for i in 0..N {
                lights[i] = if members[i] { [found[0][i], found[1][i], found[2][i]] } else { lights[i] };
            }
        }
        lights
    }

    /// What may be seen from within `slack` mm of `place`.
    pub(crate) fn sight(&self, place: Vector3<f64>, slack: f64) -> Sight {
        let boxes = self.solids.iter().map(Solid::turned_box).enumerate();
        Sight::new(&self.solids, Outlook::overlapping(boxes, place, slack, Sight::OVERLAP))
    }
}

impl Solid {
    /// Rays in the frame of the shape: where they start, and their directions.
    #[inline(always)]
    pub fn own<const N: usize>(&self, rays: &Packet<f64, N>) -> [Triples<N>; 2] {
        [
            turned(&self.shape_from_world, &less(&rays.origin, &self.centre)),
            turned(&self.shape_from_world, &rays.direction),
        ]
    }

    /// Puts this solid, of number `surface`, in the place of what those of the rays that count meet farther away.
    #[inline(always)]
    fn take<const N: usize>(&self, surface: u32, rays: &Packet<f64, N>, first: &mut Encounters<N>) {
        let [origin, direction] = self.own(rays);
        let met = self.shape.meet(&origin, &direction);
        let mut nearer = rays.counts;
        for ((nearer, range), first) in nearer.iter_mut().zip(&met.ranges).zip(&first.ranges) {
            *nearer &= range < first;
        }
        if !nearer.iter().any(|nearer| *nearer) {
            return;
        }
        let normals = self.shape.normals(&origin, &direction, &met);
        for (first, (range, nearer)) in first.ranges.iter_mut().zip(met.ranges.iter().zip(&nearer)) {
            *first = if *nearer { *range } else { *first };
        }
        for (first, nearer) in first.surfaces.iter_mut().zip(&nearer) {
            *first = if *nearer { surface } else { *first };
        }
        for (first, normals) in first.normals.iter_mut().zip(&normals) {
            for ((first, normal), nearer) in first.iter_mut().zip(normals).zip(&nearer) {
                *first = if *nearer { *normal } else { *first };
            }
        }
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
            let ray = Packet { origin: alone(&origin), direction: alone(&direction), counts: [true] };
            let mut nearest = Encounters::NONE;
            room.solids.iter().enumerate().for_each(|(number, solid)| solid.take(number as u32, &ray, &mut nearest));
            let found = room.encounter(origin, direction).map_or(f64::INFINITY, |(_, met)| met.ranges[0]);
            assert_eq!(
                found.to_bits(),
                nearest.ranges[0].to_bits(),
                "{origin} {direction}: {found} is not {nearest:?}"
            );
        }
    }

    /// Rays from about one place, some of which start beside it, and their light: followed side by side they are as each alone.
    #[test]
    fn rays_side_by_side_meet_and_see_what_each_does_alone() {
        let room = Scene::room();
        let mut random = Pcg64Mcg::seed_from_u64(4);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| random.random_range(-reach..reach));
        let place = Vector3::new(-60.0, 20.0, 10.0);
        let outlook = room.outlook(place, 1.0);
        for round in 0..2000 {
            let towards = vector(1.0).normalize();
            let mut rays =
                Packet::<f64, LANES> { origin: [[0.0; LANES]; 3], direction: [[0.0; LANES]; 3], counts: [true; LANES] };
            for i in 0..LANES {
                let (origin, direction) = (place + vector(0.7), (towards + vector(0.02)).normalize());
                for axis in 0..3 {
                    (rays.origin[axis][i], rays.direction[axis][i]) = (origin[axis], direction[axis]);
                }
                rays.counts[i] = (round + i) % 5 != 0;
            }
            let spreads = [1e-3; LANES];
            let met = meet_many(&room, &outlook, &rays);
            let lights = light_many(&room, &rays, &met, &spreads);
            for i in (0..LANES).filter(|&i| rays.counts[i]) {
                let (ray, one) =
                    room.encounter(one_of(&rays.origin, i), one_of(&rays.direction, i)).expect("a closed room");
                let [light] = room.lights(&ray, &one, &[spreads[i]]);
                assert_eq!((met.surfaces[i], met.ranges[i].to_bits()), (one.surfaces[0], one.ranges[0].to_bits()));
                assert_eq!(lights[i].map(f32::to_bits), light.map(f32::to_bits), "{:?} is not {light:?}", lights[i]);
            }
        }
    }
}
