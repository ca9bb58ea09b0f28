//! Where the rays of a camera start and go, in single precision.

use multiversion::multiversion;
use vergence_vision::{Camera, Transform, World};

use crate::packet::{Packet, QUICK_LANES, Singles};
use crate::quick::TILE;

/// The pose of a camera at the exposure of a row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Eye {
    /// Rows of the turn from the camera's frame to the world.
    turn: [[f32; 3]; 3],
    /// In the world, mm.
    origin: [f32; 3],
}

impl Eye {
    /// Of this pose.
    pub fn new(world_from_camera: &Transform<World, Camera>) -> Self {
        let (turn, origin) = (world_from_camera.rotation().to_rotation_matrix(), world_from_camera.origin().mm());
        Self {
            turn: [0, 1, 2].map(|row| [0, 1, 2].map(|column| turn[(row, column)] as f32)),
            origin: [0, 1, 2].map(|axis| origin[axis] as f32),
        }
    }

    /// A vector of the camera's frame in the world.
    pub fn in_world(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [a, b, c] = &self.turn;
        [a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z]
    }

    /// The place in the world at so many mm along the axis.
    pub fn pupil(&self, along: f32) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.origin[axis] + self.turn[axis][2] * along)
    }
}

/// The poses of the rows of a tile, for each of its pixels.
#[derive(Clone, Debug)]
pub struct TileEyes {
    turn: [Singles<QUICK_LANES>; 3],
    origin: Singles<QUICK_LANES>,
}

impl TileEyes {
    /// Of up to as many rows as a tile has.
    pub fn new(eyes: &[Eye]) -> Self {
        let mut all = Self { turn: [[[0.0; QUICK_LANES]; 3]; 3], origin: [[0.0; QUICK_LANES]; 3] };
        for (lane, eye) in eyes.iter().flat_map(|eye| std::iter::repeat_n(eye, TILE)).enumerate() {
            for axis in 0..3 {
                all.origin[axis][lane] = eye.origin[axis];
                (0..3).for_each(|column| all.turn[axis][column][lane] = eye.turn[axis][column]);
            }
        }
        all
    }

    /// Sets rays to those of these directions of the camera's frame that cross its axis so many mm from its origin; directions that are not
    /// numbers do not count.
    pub fn aim(
        &self,
        rays: &mut Packet<f32, QUICK_LANES>,
        directions: &Singles<QUICK_LANES>,
        pupils: &[f32; QUICK_LANES],
    ) {
        aim_many(self, rays, directions, pupils);
    }
}

/// [`TileEyes::aim`], by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn aim_many(
    eyes: &TileEyes,
    rays: &mut Packet<f32, QUICK_LANES>,
    directions: &Singles<QUICK_LANES>,
    pupils: &[f32; QUICK_LANES],
) {
    for (counts, z) in rays.counts.iter_mut().zip(&directions[2]) {
        *counts = !z.is_nan();
    }
    for axis in 0..3 {
        let turn = &eyes.turn[axis];
        for i in 0..QUICK_LANES {
            let turned = turn[0][i] * directions[0][i] + turn[1][i] * directions[1][i] + turn[2][i] * directions[2][i];
            rays.origin[axis][i] = eyes.origin[axis][i] + turn[2][i] * pupils[i];
            rays.direction[axis][i] = if directions[2][i].is_nan() { 0.0 } else { turned };
        }
    }
}
