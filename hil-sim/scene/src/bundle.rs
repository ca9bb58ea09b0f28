//! Rays of many pixels, gathered to be followed side by side.

use nalgebra::Vector3;

use crate::Scene;
use crate::outlook::Outlook;
use crate::packet::{LANES, Packet};
use crate::texture::Rgb;
use crate::trace::{light_many, meet_many};

/// Rays in the order in which they were gathered.
#[derive(Debug, Default)]
pub struct Bundle(Vec<Ray>);

#[derive(Clone, Copy, Debug)]
struct Ray {
    /// Which pixel it is of.
    owner: usize,
    origin: Vector3<f64>,
    direction: Vector3<f64>,
    /// Radians to the neighbouring rays.
    spread: f64,
}

/// What a ray found.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Number of the surface, or [`NOTHING`](crate::trace::NOTHING).
    pub surface: u32,
    /// Distance along the ray, mm; infinite where nothing is met.
    pub range_mm: f64,
    /// Linear colour, where it was wanted.
    pub light: Rgb,
}

impl Bundle {
    /// Adds a ray of a pixel, in the world.
    pub fn push(&mut self, owner: usize, origin: Vector3<f64>, direction: Vector3<f64>, spread: f64) {
        self.0.push(Ray { owner, origin, direction, spread });
    }

    /// Follows the rays, and calls `visit(owner, found)` for each of them in their order; none is left. `wants_light(owner, surface)` tells
    /// whether a ray that meets this surface needs its light, which takes most of the time.
    pub fn follow(
        &mut self,
        scene: &Scene,
        outlook: &Outlook,
        wants_light: impl Fn(usize, u32) -> bool,
        mut visit: impl FnMut(usize, Found),
    ) {
        for rays in self.0.chunks(LANES) {
            let none = [[0.0; LANES]; 3];
            let (mut packet, mut spreads) =
                (Packet { origin: none, direction: none, counts: [false; LANES] }, [0.0; LANES]);
            for (i, ray) in rays.iter().enumerate() {
                for axis in 0..3 {
                    (packet.origin[axis][i], packet.direction[axis][i]) = (ray.origin[axis], ray.direction[axis]);
                }
                (packet.counts[i], spreads[i]) = (true, ray.spread);
            }
            let met = meet_many(scene, outlook, &packet);
            for (i, ray) in rays.iter().enumerate() {
                packet.counts[i] = wants_light(ray.owner, met.surfaces[i]);
            }
            let is_wanted = packet.counts.iter().any(|wanted| *wanted);
            let lights = if is_wanted { light_many(scene, &packet, &met, &spreads) } else { [[0.0; 3]; LANES] };
            for (i, ray) in rays.iter().enumerate() {
                let found = Found { surface: met.surfaces[i], range_mm: met.ranges[i], light: lights[i] };
                visit(ray.owner, found);
            }
        }
        self.0.clear();
    }
}
