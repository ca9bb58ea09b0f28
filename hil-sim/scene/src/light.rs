//! The light of a room: ambient, darkened towards its edges, and lamps that cast shadows.

use nalgebra::Vector3;

use crate::real::Real;
use crate::texture::Rgb;

/// A lamp as a point, whose light falls off with the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Position in the world, mm.
    pub position: Vector3<f64>,
    /// Irradiance at a surface that faces the lamp from nearby.
    pub power: Rgb,
    /// Distance at which the irradiance is a half of that.
    pub half_distance: f64,
}

/// All light of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// Ambient irradiance, the same from all directions.
    pub ambient: Rgb,
    /// How much brighter than on walls the ambient light is on surfaces that face up, and darker on those that face
    /// down, 0 to 1.
    pub from_above: f64,
    /// Share of the ambient light that is lost in the edges of the room, 0 to 1.
    pub occlusion: f64,
    /// Opposite corners of the room: ambient light is dimmed near its sides.
    pub room: [Vector3<f64>; 2],
    /// The lamps.
    pub lamps: Vec<Lamp>,
}

impl Lamp {
    /// The parts of the lamp's power that arrive at `points` on a surface with `normals` where nothing is between; from behind not above 0.
    #[inline(always)]
    pub fn shares<T: Real, const N: usize>(&self, points: &[[T; N]; 3], normals: &[[T; N]; 3]) -> [f32; N] {
        let (at, half_distance) = ([0, 1, 2].map(|axis| T::of(self.position[axis])), T::of(self.half_distance));
        let mut shares = [0.0; N];
        for i in 0..N {
            let [x, y, z] = [at[0] - points[0][i], at[1] - points[1][i], at[2] - points[2][i]];
            let distance = (x * x + y * y + z * z).sqrt();
            let cosine = (normals[0][i] * x + normals[1][i] * y + normals[2][i] * z) / distance.max(T::of(1.0));
            let reach = distance / half_distance;
            shares[i] = (cosine * (T::of(1.0) / (T::of(1.0) + reach * reach))).single();
        }
        shares
    }
}

impl Lighting {
    /// The parts of the ambient irradiance that arrive at `points` on a surface with `normals`, both in the world.
    #[inline(always)]
    pub fn ambients<T: Real, const N: usize>(&self, points: &[[T; N]; 3], normals: &[[T; N]; 3]) -> [f32; N] {
        let (opennesses, from_above) = (self.opennesses(points, normals), T::of(self.from_above));
        let mut parts = [0.0; N];
        for i in 0..N {
            // y is down.
            let above = T::of(1.0) - from_above * normals[1][i];
            parts[i] = (above * opennesses[i]).single();
        }
        parts
    }

    /// The part of ambient light that reaches points near the room's sides; a side does not shade itself.
    #[inline(always)]
    fn opennesses<T: Real, const N: usize>(&self, points: &[[T; N]; 3], normals: &[[T; N]; 3]) -> [T; N] {
        const REACH_MM: f64 = 220.0;
        let one = T::of(1.0);
        let mut open = [one; N];
        if self.occlusion == 0.0 {
            return open;
        }
        let occlusion = T::of(self.occlusion);
        for axis in 0..3 {
            let [low, high] = self.room.map(|corner| T::of(corner[axis]));
            for i in 0..N {
                let nearest = (points[axis][i] - low).min(high - points[axis][i]).max(T::of(0.0));
                let away = one + nearest * T::of(1.0 / REACH_MM);
                let near = one / (away * away);
                open[i] = open[i] * (one - occlusion * near * (one - normals[axis][i].abs()));
            }
        }
        open
    }
}
