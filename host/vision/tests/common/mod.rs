//! What several tests of this crate need: lenses, rigs, sights of points, and Gaussian numbers.

#![allow(dead_code, reason = "every test uses a part")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Pixel, PixelPair, Point, Right, StereoPair, Transform};

pub const BASELINE: f64 = 145.0;

/// 560 px/rad over 2080 × 2080 pixels, as the precision bench.
pub fn lens(k1: f64) -> KannalaBrandt {
    let size = ImageSize { width: 2080, height: 2080 };
    let k = [560.0, 560.0 * k1, 0.0, 0.0, 0.0];
    KannalaBrandt::new(k, 1.0, Pixel { u: 1039.5, v: 1039.5 }, Angle::from_deg(98.0), size).unwrap()
}

/// Cameras 145 mm apart with their axes `separation` degrees apart, outward.
pub fn left_from_right(separation: f64) -> Transform<Left, Right> {
    let half = separation.to_radians() / 2.0;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.0 * half);
    Transform::new(turned, Vector3::new(BASELINE * half.cos(), 0.0, -BASELINE * half.sin()))
}

/// The rig's axes, x along the baseline and z forward between the cameras, seen in the left frame; the origin is halfway
/// between the centres.
pub fn left_from_middle(separation: f64) -> Transform<Left, vergence_vision::Base> {
    let half = separation.to_radians() / 2.0;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), half);
    Transform::new(turned, turned * Vector3::new(BASELINE / 2.0, 0.0, 0.0))
}

/// `range` from the middle of the rig, at an azimuth to the right and an elevation upwards in degrees; rig axes.
pub fn around(range: f64, azimuth: f64, elevation: f64) -> Vector3<f64> {
    let (az, el) = (azimuth.to_radians(), elevation.to_radians());
    Vector3::new(az.sin() * el.cos(), -el.sin(), az.cos() * el.cos()) * range
}

pub fn see(pair: &StereoPair<'_>, point: &Point<Left>) -> Option<PixelPair> {
    let left = pair.left.project_point(point).ok()?;
    let right = pair.right.project_point(&(pair.left_from_right.inverse() * *point)).ok()?;
    Some(PixelPair { left, right })
}

/// Gaussian numbers from SplitMix64 (Steele, Lea and Flood, 2014) by the Box-Muller method.
pub struct Gaussian(pub u64);

impl Gaussian {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (0.5f64).powi(53)
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// `pixel` with noise of standard deviation `sigma` in u and v.
    pub fn noisy(&mut self, pixel: Pixel, sigma: f64) -> Pixel {
        Pixel { u: pixel.u + sigma * self.normal(), v: pixel.v + sigma * self.normal() }
    }
}

/// From the environment, for long runs.
pub fn count(variable: &str, otherwise: u32) -> u32 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}
