//! Lens and sensor: sharpness and brightness of the image, and the grey level of light.

use vergence_vision::Angle;

use crate::lens::Lens;
use crate::texture::Rgb;
use crate::texture_noise::mix64;

/// Lens and sensor of one camera. A value outside its range counts as the nearest end of the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Rays cast for every pixel, spread over its square. A single ray goes through its centre: enough where
    /// only edges are finer than a pixel.
    pub samples: u32,
    /// Further rays for a pixel at an edge: where its first ones differ, or its neighbours' much. Where edges are
    /// measured to hundredths of a pixel, as on a checkerboard, take some hundreds.
    pub edge_samples: u32,
    /// Standard deviation of the lens's point spread in pixels, 0 to 5. The pixel's own square adds 1/12 px² to the
    /// variance.
    pub blur_px: f64,
    /// Standard deviation of the noise in the dark, in grey levels of 255.
    pub read_noise: f64,
    /// Additional standard deviation of a white pixel, in grey levels of 255. Its variance is proportional to the
    /// grey level: that of level g is `read_noise² + shot_noise² g / 255`.
    pub shot_noise: f64,
    /// Part of the light that is lost at the edge of the field of an ideal lens, 0 to 1. See [`Optics::falloff`]. A traced lens
    /// has its own light.
    pub vignette: f64,
    /// Factor on the light: exposure and analogue gain. At 1 a white sheet in full light is white.
    pub gain: f64,
}

impl Default for Optics {
    /// An average lens and a low-noise sensor: σ = 0.5 px, noise of 1 to 1.6 grey levels, two fifths lost at the edge.
    fn default() -> Self {
        Self { samples: 6, edge_samples: 12, blur_px: 0.5, read_noise: 1.0, shot_noise: 1.2, vignette: 0.4, gain: 1.0 }
    }
}

impl Optics {
    /// A perfect camera: no blur beyond the pixel, no noise, no vignette, and edges sampled finely.
    #[must_use]
    pub const fn ideal() -> Self {
        Self { samples: 6, edge_samples: 200, blur_px: 0.0, read_noise: 0.0, shot_noise: 0.0, vignette: 0.0, gain: 1.0 }
    }

    /// The part of the light that arrives at `theta` from the axis:
    /// 1 - vignette · sin²(π/2 · θ/θmax), which is cos² of the scaled angle where the vignette is total.
    #[must_use]
    pub fn falloff(&self, theta: Angle, theta_max: Angle) -> f64 {
        let part = (theta.rad() / theta_max.rad()).clamp(0.0, 1.0);
        1.0 - self.vignette.clamp(0.0, 1.0) * (std::f64::consts::FRAC_PI_2 * part).sin().powi(2)
    }

    /// The part of the light that arrives at `theta` from the axis of a lens: by its design, or by [`Self::falloff`].
    pub(crate) fn light_at(&self, theta: Angle, lens: &dyn Lens) -> f64 {
        lens.illumination(theta).unwrap_or_else(|| self.falloff(theta, lens.theta_max()))
    }

    /// The 8-bit pixel of linear light `colour`, with the noise that the hash `noise` gives.
    pub(crate) fn expose(&self, colour: Rgb, noise: u64) -> [u8; 3] {
        std::array::from_fn(|channel| self.level(f64::from(colour[channel]), normals(mix64(noise ^ channel as u64))[0]))
    }

    /// The 8-bit level of linear `light`, with noise of `normal` standard deviations.
    pub(crate) fn level(&self, light: f64, normal: f64) -> u8 {
        let (read, shot, gain) = (self.read_noise.max(0.0), self.shot_noise.max(0.0), self.gain.max(0.0));
        let level = 255.0 * encoded(gain * light);
        let sigma = (read * read + shot * shot * level / 255.0).sqrt();
        // Adding a half and cutting rounds; below 0 it is 0, and above 255 it is 255.
        (level + sigma * normal + 0.5) as u8
    }
}

/// The sRGB transfer function (IEC 61966-2-1): linear to encoded, both 0 to 1.
pub fn encoded(linear: f64) -> f64 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Two standard normal numbers from a hash (G. Box and M. Muller, Ann. Math. Stat. 29, 1958).
pub fn normals(hash: u64) -> [f64; 2] {
    let (a, b) = unit_pair(hash);
    let radius = (-2.0 * (1.0 - a).ln()).sqrt();
    let (sine, cosine) = (std::f64::consts::TAU * b).sin_cos();
    [radius * cosine, radius * sine]
}

/// Two numbers in [0, 1) from a hash.
pub fn unit_pair(hash: u64) -> (f64, f64) {
    const SCALE: f64 = 1.0 / 4_294_967_296.0;
    ((hash >> 32) as f64 * SCALE, (hash & 0xffff_ffff) as f64 * SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_encoding_has_its_published_values() {
        // IEC 61966-2-1: linear 0.2140 is encoded 0.5; the two branches meet at 0.04045.
        assert!((encoded(0.214_041) - 0.5).abs() < 1e-5);
        assert!((encoded(0.003_130_8) - 0.040_45).abs() < 1e-5);
        assert!(encoded(0.0).abs() < 1e-12 && (encoded(1.0) - 1.0).abs() < 1e-12);
    }
}
