//! Rays of many pixels, followed side by side in single precision, and then given light surface by surface.
//!
//! Rays that meet one surface do the same, so that none of those side by side waits for another.

use crate::Scene;
use crate::packet::{Packet, QUICK_LANES, Singles};
use crate::radiance::{glance_many, glance_some};
use crate::sight::{Sight, first_many};
use crate::texture::Rgb;
use crate::trace::NOTHING;

/// Rays of one pixel at most.
pub const MOST_OF_PIXEL: usize = 16;

/// Rays in the order in which they were gathered.
#[derive(Debug, Default)]
pub struct QuickBundle {
    /// Those in use, and then others that are there to be used again.
    blocks: Vec<Block>,
    used: usize,
    /// Rays of the last block in use.
    in_last: usize,
    /// Surfaces, and the numbers of rays that meet them, beside which others meet other surfaces.
    alone: Vec<[u32; 2]>,
    /// The same, surface by surface.
    sorted: Vec<[u32; 2]>,
}

/// Rays that are followed side by side, and what they found.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// In the world; only some count.
    pub rays: Packet<f32, QUICK_LANES>,
    /// Which pixels they are of.
    pub owners: [u32; QUICK_LANES],
    /// Radians to the neighbouring rays.
    pub spreads: [f32; QUICK_LANES],
    /// What they meet first, or [`NOTHING`], and how far away that is, mm.
    pub surfaces: [u32; QUICK_LANES],
    ranges: [f32; QUICK_LANES],
    /// Red, green and blue, where they were wanted.
    pub lights: Singles<QUICK_LANES>,
}

impl Block {
    /// Without rays that count.
    pub const EMPTY: Self = Self {
        rays: Packet {
            origin: [[0.0; QUICK_LANES]; 3],
            direction: [[0.0; QUICK_LANES]; 3],
            counts: [false; QUICK_LANES],
        },
        owners: [0; QUICK_LANES],
        spreads: [0.0; QUICK_LANES],
        surfaces: [NOTHING; QUICK_LANES],
        ranges: [0.0; QUICK_LANES],
        lights: [[0.0; QUICK_LANES]; 3],
    };

    fn give_light(&mut self, scene: &Scene, surface: u32) {
        self.lights = glance_many(scene, surface, &self.rays, [&self.ranges, &self.spreads]);
    }
}

impl QuickBundle {
    /// Adds rays of a pixel from one place in the world: the first `count` of these directions. Tells the number of the first of them.
    pub fn push(
        &mut self,
        owner: usize,
        origin: [f32; 3],
        (directions, count): (&Singles<MOST_OF_PIXEL>, usize),
        spread: f32,
    ) -> usize {
        let first = self.used.saturating_sub(1) * QUICK_LANES + self.in_last;
        let mut from = 0;
        while from < count {
            if self.used == 0 || self.in_last == QUICK_LANES {
                self.add_block();
                self.in_last = 0;
            }
            let (block, at) = (&mut self.blocks[self.used - 1], self.in_last);
            let some = (count - from).min(QUICK_LANES - at);
            for i in 0..some {
                for axis in 0..3 {
                    block.rays.origin[axis][at + i] = origin[axis];
                    block.rays.direction[axis][at + i] = directions[axis][from + i];
                }
                block.rays.counts[at + i] = true;
                block.owners[at + i] = owner as u32;
                block.spreads[at + i] = spread;
            }
            (self.in_last, from) = (at + some, from + some);
        }
        first
    }

    /// The light of a ray by its number.
    #[inline]
    pub fn light(&self, ray: usize) -> Rgb {
        let ([red, green, blue], lane) = (&self.blocks[ray / QUICK_LANES].lights, ray % QUICK_LANES);
        [red[lane], green[lane], blue[lane]]
    }

    /// Adds rays that are side by side, and which the caller sets: those that do not count have any numbers.
    pub fn add_block(&mut self) -> &mut Block {
        if self.used == self.blocks.len() {
            self.blocks.push(Block::EMPTY);
        }
        (self.used, self.in_last) = (self.used + 1, QUICK_LANES);
        let block = &mut self.blocks[self.used - 1];
        block.rays.counts = [false; QUICK_LANES];
        block
    }

    /// Takes the last block away.
    pub const fn drop_block(&mut self) {
        self.used -= 1;
    }

    /// What is in the bundle.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks[..self.used]
    }

    /// Takes all rays away.
    pub const fn clear(&mut self) {
        (self.used, self.in_last) = (0, 0);
    }

    /// Follows the rays, and notes in the blocks what they found. `known(owner, surface)` is the light of a ray that meets this surface, if it is
    /// known: to find it takes most of the time.
    pub fn follow(&mut self, scene: &Scene, sight: &Sight, known: impl Fn(usize, u32) -> Option<Rgb>) {
        self.alone.clear();
        for (number, block) in self.blocks[..self.used].iter_mut().enumerate() {
            (block.surfaces, block.ranges) = first_many(sight, &block.rays);
            for (lights, backdrop) in block.lights.iter_mut().zip(scene.backdrop) {
                for (light, counts) in lights.iter_mut().zip(&block.rays.counts) {
                    *light = if *counts { backdrop } else { 0.0 };
                }
            }
            let mut wanted = [false; QUICK_LANES];
            for (i, wanted) in wanted.iter_mut().enumerate().filter(|(i, _)| block.surfaces[*i] != NOTHING) {
                match known(block.owners[i] as usize, block.surfaces[i]) {
                    Some(light) => (0..3).for_each(|channel| block.lights[channel][i] = light[channel]),
                    None => *wanted = true,
                }
            }
            let first = wanted.iter().position(|wanted| *wanted).map(|first| block.surfaces[first]);
            let Some(surface) = first else { continue };
            if wanted.iter().zip(&block.surfaces).all(|(wanted, other)| *wanted & (*other == surface)) {
                block.give_light(scene, surface);
                continue;
            }
            for i in (0..QUICK_LANES).filter(|&i| wanted[i]) {
                self.alone.push([block.surfaces[i], (number * QUICK_LANES + i) as u32]);
            }
        }
        self.light_alone(scene);
    }

    /// Light for rays beside which others meet other surfaces: those of one surface together.
    fn light_alone(&mut self, scene: &Scene) {
        sort_by_surface(&self.alone, &mut self.sorted, scene.solids.len());
        let (blocks, sorted) = (&mut self.blocks, &self.sorted);
        for of_surface in sorted.chunk_by(|[a, _], [b, _]| a == b) {
            let surface = of_surface[0][0];
            for members in of_surface.chunks(QUICK_LANES) {
                if members.len() > QUICK_LANES / 2 {
                    light_together(blocks, members, |rays, ranges| glance_many(scene, surface, rays, ranges));
                } else {
                    light_together(blocks, members, |rays, ranges| glance_some(scene, surface, rays, ranges));
                }
            }
        }
    }
}

/// Light for these of the rays, which all meet one surface.
fn light_together<const N: usize>(
    blocks: &mut [Block],
    members: &[[u32; 2]],
    lights: impl Fn(&Packet<f32, N>, [&[f32; N]; 2]) -> Singles<N>,
) {
    let mut rays = Packet { origin: [[0.0; N]; 3], direction: [[0.0; N]; 3], counts: [false; N] };
    let (mut ranges, mut spreads) = ([0.0; N], [0.0; N]);
    let place = |ray: u32| (ray as usize / QUICK_LANES, ray as usize % QUICK_LANES);
    for (to, [_, ray]) in members.iter().enumerate() {
        let (block, from) = place(*ray);
        let block = &blocks[block];
        for axis in 0..3 {
            rays.origin[axis][to] = block.rays.origin[axis][from];
            rays.direction[axis][to] = block.rays.direction[axis][from];
        }
        (rays.counts[to], ranges[to], spreads[to]) = (true, block.ranges[from], block.spreads[from]);
    }
    let lights = lights(&rays, [&ranges, &spreads]);
    for (from, [_, ray]) in members.iter().enumerate() {
        let (block, to) = place(*ray);
        let block = &mut blocks[block];
        (0..3).for_each(|channel| block.lights[channel][to] = lights[channel][from]);
    }
}

/// Puts rays in the order of their surfaces, of which there are so many, and otherwise leaves their order.
fn sort_by_surface(rays: &[[u32; 2]], sorted: &mut Vec<[u32; 2]>, surfaces: usize) {
    let mut next = vec![0_u32; surfaces + 1];
    rays.iter().for_each(|[surface, _]| next[*surface as usize + 1] += 1);
    (1..next.len()).for_each(|surface| next[surface] += next[surface - 1]);
    sorted.clear();
    sorted.resize(rays.len(), [0; 2]);
    for ray in rays {
        let next = &mut next[ray[0] as usize];
        sorted[*next as usize] = *ray;
        *next += 1;
    }
}
