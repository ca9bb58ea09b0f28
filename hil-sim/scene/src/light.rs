//! The light of a room: ambient, darkened towards its edges, and lamps that cast shadows.

use nalgebra::Vector3;

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

impl Lighting {
    /// Irradiance at `point` on a surface with `normal`, both in the world; `visible` tells whether the lamp of a
    /// number can be seen from the point.
    pub fn irradiance(&self, point: Vector3<f64>, normal: Vector3<f64>, visible: impl Fn(usize) -> bool) -> Rgb {
        // y is down.
        let above = 1.0 - self.from_above * normal.y;
        let mut sum = self.ambient.map(|c| c * (above * self.openness(point, normal)) as f32);
        for (number, lamp) in self.lamps.iter().enumerate() {
            let to_lamp = lamp.position - point;
            let distance = to_lamp.norm();
            let cosine = normal.dot(&to_lamp) / distance.max(1.0);
            if cosine > 0.0 && visible(number) {
                let fall = 1.0 / (1.0 + (distance / lamp.half_distance).powi(2));
                sum = std::array::from_fn(|i| sum[i] + lamp.power[i] * (cosine * fall) as f32);
            }
        }
        sum
    }

    /// The part of ambient light that reaches a point near the room's sides; a side does not shade itself.
    fn openness(&self, point: Vector3<f64>, normal: Vector3<f64>) -> f64 {
        const REACH_MM: f64 = 220.0;
        if self.occlusion == 0.0 {
            return 1.0;
        }
        let [low, high] = self.room;
        (0..3).fold(1.0, |open, axis| {
            let nearest = (point[axis] - low[axis]).min(high[axis] - point[axis]).max(0.0);
            let near = (1.0 + nearest / REACH_MM).powi(-2);
            open * (1.0 - self.occlusion * near * (1.0 - normal[axis].abs()))
        })
    }
}
