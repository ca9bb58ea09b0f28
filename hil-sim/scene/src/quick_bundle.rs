//! Rays of many pixels, followed side by side in single precision, and then given light surface by surface.
//!
//! Rays that meet one surface do the same, so that none of those side by side waits for another.

use nalgebra::Vector3;

use crate::Scene;
use crate::packet::{LANES, Packet};
use crate::sight::{Sight, first_many};
use crate::texture::Rgb;
use crate::trace::{NOTHING, glance_many};

/// Rays in the order in which they were gathered.
#[derive(Debug, Default)]
pub struct QuickBundle(Vec<Ray>);

#[derive(Clone, Copy, Debug)]
struct Ray {
    /// Which pixel it is of.
    owner: u32,
    origin: Vector3<f64>,
    direction: Vector3<f64>,
    /// Radians to the neighbouring rays.
    spread: f64,
}

impl QuickBundle {
    /// Adds a ray of a pixel, in the world.
    pub fn push(&mut self, owner: usize, origin: Vector3<f64>, direction: Vector3<f64>, spread: f32) {
        self.0.push(Ray { owner: owner as u32, origin, direction, spread: f64::from(spread) });
    }

    /// Follows the rays, and calls `visit(owner, surface, light)` for each of them in their order; none is left.
    /// `wants_light(owner, surface)` tells whether a ray that meets this surface needs its light, which takes most of the time.
    pub fn follow(
        &mut self,
        scene: &Scene,
        sight: &Sight,
        wants_light: impl Fn(usize, u32) -> bool,
        mut visit: impl FnMut(usize, u32, Rgb),
    ) {
        let mut surfaces = Vec::with_capacity(self.0.len());
        for rays in self.0.chunks(LANES) {
            let (packet, _) = side_by_side(rays.iter());
            let first = first_many(sight, &packet.origin, &packet.direction, &packet.counts);
            surfaces.extend_from_slice(&first[..rays.len()]);
        }
        let mut lights = vec![scene.backdrop; self.0.len()];
        let wanted = |ray: usize| surfaces[ray] != NOTHING && wants_light(self.0[ray].owner as usize, surfaces[ray]);
        let by_surface = sorted(&surfaces, scene.solids.len(), wanted);
        for of_surface in by_surface.chunk_by(|a, b| surfaces[*a as usize] == surfaces[*b as usize]) {
            for numbers in of_surface.chunks(LANES) {
                let surface = surfaces[numbers[0] as usize];
                let (packet, spreads) = side_by_side(numbers.iter().map(|ray| &self.0[*ray as usize]));
                let found = glance_many(scene, surface, &packet, &spreads);
                for (ray, light) in numbers.iter().zip(found) {
                    lights[*ray as usize] = light;
                }
            }
        }
        for ((ray, surface), light) in self.0.drain(..).zip(surfaces).zip(lights) {
            visit(ray.owner as usize, surface, light);
        }
    }
}

/// The numbers of the rays that are wanted, by surface, and within one in their order.
fn sorted(surfaces: &[u32], count: usize, wanted: impl Fn(usize) -> bool) -> Vec<u32> {
    let wanted: Vec<u32> = (0..surfaces.len()).filter(|&ray| wanted(ray)).map(|ray| ray as u32).collect();
    let mut next = vec![0_usize; count + 1];
    wanted.iter().for_each(|&ray| next[surfaces[ray as usize] as usize + 1] += 1);
    for surface in 1..next.len() {
        next[surface] += next[surface - 1];
    }
    let mut sorted = vec![0; wanted.len()];
    for ray in wanted {
        let place = &mut next[surfaces[ray as usize] as usize];
        sorted[*place] = ray;
        *place += 1;
    }
    sorted
}

/// Up to as many rays as there are lanes, with their spreads.
fn side_by_side<'a>(rays: impl Iterator<Item = &'a Ray>) -> (Packet<LANES>, [f64; LANES]) {
    let none = [[0.0; LANES]; 3];
    let (mut packet, mut spreads) = (Packet { origin: none, direction: none, counts: [false; LANES] }, [0.0; LANES]);
    for (i, ray) in rays.enumerate() {
        for axis in 0..3 {
            (packet.origin[axis][i], packet.direction[axis][i]) = (ray.origin[axis], ray.direction[axis]);
        }
        (packet.counts[i], spreads[i]) = (true, ray.spread);
    }
    (packet, spreads)
}
