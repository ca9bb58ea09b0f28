//! Rays of many pixels, followed side by side in single precision, and then given light surface by surface.
//!
//! Rays that meet one surface do the same, so that none of those side by side waits for another.

use crate::Scene;
use crate::packet::{Packet, QUICK_LANES, Singles};
use crate::radiance::glance_many;
use crate::sight::{Sight, first_many};
use crate::trace::NOTHING;

/// Rays in the order in which they were gathered.
#[derive(Debug, Default)]
pub struct QuickBundle {
    /// Those in use, and then others that are there to be used again.
    blocks: Vec<Block>,
    used: usize,
    /// Rays of the last block in use.
    in_last: usize,
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

    /// Puts ray `from` of another block at `to`.
    fn take(&mut self, to: usize, other: &Self, from: usize) {
        for axis in 0..3 {
            self.rays.origin[axis][to] = other.rays.origin[axis][from];
            self.rays.direction[axis][to] = other.rays.direction[axis][from];
        }
        (self.rays.counts[to], self.spreads[to], self.ranges[to]) = (true, other.spreads[from], other.ranges[from]);
    }

    fn give_light(&mut self, scene: &Scene, surface: u32) {
        self.lights = glance_many(scene, surface, &self.rays, [&self.ranges, &self.spreads]);
    }
}

impl QuickBundle {
    /// Adds a ray of a pixel, in the world.
    pub fn push(&mut self, owner: usize, origin: [f32; 3], direction: [f32; 3], spread: f32) {
        if self.used == 0 || self.in_last == QUICK_LANES {
            self.add_block();
            self.in_last = 0;
        }
        let (block, at) = (&mut self.blocks[self.used - 1], self.in_last);
        for axis in 0..3 {
            (block.rays.origin[axis][at], block.rays.direction[axis][at]) = (origin[axis], direction[axis]);
        }
        (block.rays.counts[at], block.owners[at], block.spreads[at]) = (true, owner as u32, spread);
        self.in_last += 1;
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
        self.used = 0;
    }

    /// Follows the rays, and notes in the blocks what they found. `wants_light(owner, surface)` tells whether a ray that meets this surface
    /// needs its light, which takes most of the time.
    pub fn follow(&mut self, scene: &Scene, sight: &Sight, wants_light: impl Fn(usize, u32) -> bool) {
        let mut alone = Vec::new();
        for (number, block) in self.blocks[..self.used].iter_mut().enumerate() {
            (block.surfaces, block.ranges) = first_many(sight, &block.rays);
            for (lights, backdrop) in block.lights.iter_mut().zip(scene.backdrop) {
                for (light, counts) in lights.iter_mut().zip(&block.rays.counts) {
                    *light = if *counts { backdrop } else { 0.0 };
                }
            }
            let mut wanted = [false; QUICK_LANES];
            for (wanted, (surface, owner)) in wanted.iter_mut().zip(block.surfaces.iter().zip(&block.owners)) {
                *wanted = *surface != NOTHING && wants_light(*owner as usize, *surface);
            }
            let first = wanted.iter().position(|wanted| *wanted).map(|first| block.surfaces[first]);
            let Some(surface) = first else { continue };
            if wanted.iter().zip(&block.surfaces).all(|(wanted, other)| *wanted & (*other == surface)) {
                block.give_light(scene, surface);
                continue;
            }
            for i in (0..QUICK_LANES).filter(|&i| wanted[i]) {
                alone.push(u64::from(block.surfaces[i]) << 32 | (number * QUICK_LANES + i) as u64);
            }
        }
        self.light_alone(scene, alone);
    }

    /// Light for rays beside which others meet other surfaces: those of one surface together. The upper half of each number is the
    /// surface's, the lower half the ray's.
    fn light_alone(&mut self, scene: &Scene, mut rays: Vec<u64>) {
        rays.sort_unstable();
        for of_surface in rays.chunk_by(|a, b| a >> 32 == b >> 32) {
            for members in of_surface.chunks(QUICK_LANES) {
                let mut together = Block::EMPTY;
                for (to, ray) in members.iter().enumerate() {
                    let ray = *ray as u32 as usize;
                    together.take(to, &self.blocks[ray / QUICK_LANES], ray % QUICK_LANES);
                }
                together.give_light(scene, (members[0] >> 32) as u32);
                for (from, ray) in members.iter().enumerate() {
                    let ray = *ray as u32 as usize;
                    let (block, to) = (&mut self.blocks[ray / QUICK_LANES], ray % QUICK_LANES);
                    (0..3).for_each(|channel| block.lights[channel][to] = together.lights[channel][from]);
                }
            }
        }
    }
}
