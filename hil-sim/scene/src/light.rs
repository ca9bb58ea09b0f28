//! The light of a room: ambient, darkened towards its edges, and lamps that cast shadows.

use nalgebra::Vector3;

use crate::packet::Triples;
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
    pub fn shares<const N: usize>(&self, points: &Triples<N>, normals: &Triples<N>) -> [f32; N] {
        let mut shares = [0.0; N];
        for i in 0..N {
            let [x, y, z] =
                [self.position.x - points[0][i], self.position.y - points[1][i], self.position.z - points[2][i]];
            let distance = (x * x + y * y + z * z).sqrt();
            let cosine = (normals[0][i] * x + normals[1][i] * y + normals[2][i] * z) / distance.max(1.0);
            let reach = distance / self.half_distance;
            shares[i] = (cosine * (1.0 / (1.0 + reach * reach))) as f32;
        }
        shares
    }
}

impl Lighting {
    /// Irradiance by ambient light at `points` on a surface with `normals`, both in the world.
    #[inline(always)]
    pub fn ambients<const N: usize>(&self, points: &Triples<N>, normals: &Triples<N>) -> [Rgb; N] {
        let opennesses = self.opennesses(points, normals);
        let mut sums = [[0.0; 3]; N];
        for i in 0..N {
            // y is down.
            let above = 1.0 - self.from_above * normals[1][i];
            let part = (above * opennesses[i]) as f32;
            sums[i] = [self.ambient[0] * part, self.ambient[1] * part, self.ambient[2] * part];
        }
        sums
    }

    /// The part of ambient light that reaches points near the room's sides; a side does not shade itself.
    #[inline(always)]
    fn opennesses<const N: usize>(&self, points: &Triples<N>, normals: &Triples<N>) -> [f64; N] {
        const REACH_MM: f64 = 220.0;
        let mut open = [1.0; N];
        if self.occlusion == 0.0 {
            return open;
        }
        let [low, high] = self.room;
        for axis in 0..3 {
            for i in 0..N {
                let nearest = (points[axis][i] - low[axis]).min(high[axis] - points[axis][i]).max(0.0);
                let away = 1.0 + nearest * (1.0 / REACH_MM);
                let near = 1.0 / (away * away);
                open[i] *= 1.0 - self.occlusion * near * (1.0 - normals[axis][i].abs());
            }
        }
        open
    }
}
