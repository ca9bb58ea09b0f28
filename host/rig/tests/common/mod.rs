//! Gaussian numbers for several tests.

#![allow(dead_code, reason = "every test uses a part")]

use vergence_vision::Pixel;

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
