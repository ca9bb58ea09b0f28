//! The light that comes from places on surfaces, in the precision of exact images and in that of images in real time.

use multiversion::multiversion;
use nalgebra::Vector3;

use crate::Scene;
use crate::outlook::Outlook;
use crate::packet::{Packet, QUICK_LANES, Singles, Triples, at_ranges, dots, largest, less, singles, turned};
use crate::real::Real;

/// [`Scene::glances`] of many rays, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn glance_many(
    scene: &Scene,
    surface: u32,
    rays: &Packet<f32, QUICK_LANES>,
    [ranges, spreads]: [&[f32; QUICK_LANES]; 2],
) -> Singles<QUICK_LANES> {
    scene.glances(surface, rays, ranges, spreads)
}

/// [`glance_many`] of half as many rays.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn glance_some(
    scene: &Scene,
    surface: u32,
    rays: &Packet<f32, { QUICK_LANES / 2 }>,
    [ranges, spreads]: [&[f32; QUICK_LANES / 2]; 2],
) -> Singles<{ QUICK_LANES / 2 }> {
    scene.glances(surface, rays, ranges, spreads)
}

/// Where rays meet one surface.
pub struct Contacts<'a, T, const N: usize> {
    /// Those of them that count, and their directions in the world.
    pub rays: &'a Packet<T, N>,
    /// Distances along the rays, mm.
    pub ranges: &'a [T; N],
    /// Places in the world, mm.
    pub points: [[T; N]; 3],
    /// The same in the frame of the shape.
    pub positions: [[T; N]; 3],
    /// There too, of length 1.
    pub normals: [[T; N]; 3],
}

/// Numbers in which light is followed: each precision finds in its own way what stands before lamps.
pub trait Precision: Real {
    /// Those of the `points` asked for, on a surface with `normals`, between which and a lamp nothing stands.
    fn seen<const N: usize>(
        scene: &Scene,
        lamp: usize,
        surface: u32,
        points: &[[Self; N]; 3],
        normals: &[[Self; N]; 3],
        asked: &[bool; N],
    ) -> [bool; N];
}

impl Precision for f64 {
    #[inline(always)]
    fn seen<const N: usize>(
        scene: &Scene,
        lamp: usize,
        _: u32,
        points: &Triples<N>,
        normals: &Triples<N>,
        asked: &[bool; N],
    ) -> [bool; N] {
        scene.seen(points, normals, (scene.lighting.lamps[lamp].position, &scene.shades[lamp]), asked)
    }
}

impl Precision for f32 {
    #[inline(always)]
    fn seen<const N: usize>(
        scene: &Scene,
        lamp: usize,
        surface: u32,
        points: &Singles<N>,
        _: &Singles<N>,
        asked: &[bool; N],
    ) -> [bool; N] {
        scene.quick_shades[lamp].reached(points, surface, asked)
    }
}

impl Scene {
    /// The light along those of the rays that count, which meet this surface first, at these ranges.
    #[inline(always)]
    fn glances<const N: usize>(
        &self,
        surface: u32,
        rays: &Packet<f32, N>,
        ranges: &[f32; N],
        spreads: &[f32; N],
    ) -> Singles<N> {
        let solid = &self.solids[surface as usize];
        let points = at_ranges(&rays.origin, &rays.direction, ranges);
        let positions = turned(&solid.shape_from_world, &less(&points, &solid.centre));
        let normals = solid.shape.outward(&positions, &turned(&solid.shape_from_world, &rays.direction));
        self.radiances(surface, &Contacts { rays, ranges, points, positions, normals }, spreads)
    }

    /// The linear colours where rays meet a surface; of those that do not count, any.
    #[inline(always)]
    pub(crate) fn radiances<T: Precision, const N: usize>(
        &self,
        surface: u32,
        contacts: &Contacts<'_, T, N>,
        spreads: &[T; N],
    ) -> Singles<N> {
        // Texture seen at a slant is compressed; more than this factor would blur it across as well.
        const MOST_SLANTED: f64 = 0.4;
        let (solid, Contacts { rays, points, .. }) = (&self.solids[surface as usize], contacts);
        let normals = turned(&solid.world_from_shape, &contacts.normals);
        let slants = dots(&normals, &rays.direction);
        let mut footprints = [T::of(0.0); N];
        for i in 0..N {
            footprints[i] = contacts.ranges[i] * spreads[i] / slants[i].abs().max(T::of(MOST_SLANTED));
        }
        let at = solid.shape.surface_points(contacts.positions, &contacts.normals, footprints);
        let reflectances = solid.material.pattern.reflectances(&at, solid.material.seed, &rays.counts);
        let mut lights = [[0.0; N]; 3];
        if let Some(glow) = solid.material.glow {
            lights = [[glow; N]; 3];
        } else {
            let ambients = self.lighting.ambients(points, &normals);
            for (lights, power) in lights.iter_mut().zip(self.lighting.ambient) {
                for i in 0..N {
                    lights[i] = power * ambients[i];
                }
            }
            for (number, lamp) in self.lighting.lamps.iter().enumerate() {
                let shares = lamp.shares(points, &normals);
                let (mut lit, mut is_any_lit) = (rays.counts, false);
                for i in 0..N {
                    lit[i] &= shares[i] > 0.0;
                    is_any_lit |= lit[i];
                }
                if !is_any_lit {
                    continue;
                }
                let seen = T::seen(self, number, surface, points, &normals, &lit);
                for (lights, power) in lights.iter_mut().zip(lamp.power) {
                    for i in 0..N {
                        lights[i] += if seen[i] { power * shares[i] } else { 0.0 };
                    }
                }
            }
        }
        for (lights, reflectances) in lights.iter_mut().zip(&reflectances) {
            for i in 0..N {
                lights[i] *= reflectances[i];
            }
        }
        lights
    }

    /// Those of the points asked for, on surfaces with `normals`, between which and a lamp nothing stands; `shades` are of the lamp.
    #[inline(always)]
    fn seen<const N: usize>(
        &self,
        points: &Triples<N>,
        normals: &Triples<N>,
        (lamp, shades): (Vector3<f64>, &Outlook),
        asked: &[bool; N],
    ) -> [bool; N] {
        const CLEARANCE_MM: f64 = 1e-3;
        let mut rays = Packet { origin: *points, direction: *points, counts: *asked };
        for axis in 0..3 {
            let rays = rays.origin[axis].iter_mut().zip(&mut rays.direction[axis]);
            for ((origin, direction), normal) in rays.zip(&normals[axis]) {
                *origin += normal * CLEARANCE_MM;
                *direction = lamp[axis] - *origin;
            }
        }
        let distances = dots(&rays.direction, &rays.direction).map(f64::sqrt);
        let mut from_lamp = rays.direction;
        from_lamp.as_flattened_mut().iter_mut().for_each(|component| *component = -*component);
        let cells = shades.cells(&singles(&from_lamp));
        let mut seen = *asked;
        let mut candidates = shades.candidates(asked, &cells);
        while let Some(candidate) = candidates.next() {
            if f64::from(candidate.from_mm) > largest(&distances, &seen, f64::NEG_INFINITY) {
                break;
            }
            let solid = &self.solids[candidate.shape as usize];
            let [origin, direction] = solid.own(&rays);
            let met = solid.shape.meet(&origin, &direction);
            for (seen, range) in seen.iter_mut().zip(&met.ranges) {
                let is_between = *range < 1.0;
                *seen &= !is_between;
            }
        }
        seen
    }
}
