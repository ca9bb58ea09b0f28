//! The image that a sensor makes of light, for images in real time.

use std::sync::LazyLock;

use image::RgbImage;
use multiversion::multiversion;
use rayon::prelude::*;

use crate::optics::encoded;
use crate::packet::LANES;
use crate::render::View;
use crate::texture::Rgb;
use crate::texture_noise::mix64;

/// The grey level of light, 0 to 1, before noise, at steps of its square root.
static LEVELS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=LEVEL_STEPS).map(|step| (255.0 * encoded((step as f64 / LEVEL_STEPS as f64).powi(2))) as f32).collect()
});
const LEVEL_STEPS: usize = 4096;

/// Read noise, shot noise and gain: as in [`Optics`](crate::Optics).
type Sensor = [f32; 3];

/// The image that the sensor makes of light; black outside the field, where `rays` of the pixels and of one more on every side are not numbers.
pub fn develop(light: &[Rgb], rays: &[[f64; 3]], view: &View<'_>, noise: u64) -> RgbImage {
    let (size, optics) = (view.camera.size(), view.optics);
    let width = (size.width as usize).max(1);
    let sensor = [optics.read_noise, optics.shot_noise, optics.gain].map(|value| value.max(0.0) as f32);
    let levels: &[f32] = &LEVELS;
    let mut image = RgbImage::new(size.width, size.height);
    image.par_chunks_exact_mut(3 * width).zip(light.par_chunks(width)).enumerate().for_each(|(y, (row, light))| {
        let in_field = &rays[(y + 1) * (width + 2) + 1..];
        for (part, (pixels, light)) in row.chunks_mut(3 * LANES).zip(light.chunks(LANES)).enumerate() {
            let mut lights = [[0.0; 3]; LANES];
            lights[..light.len()].copy_from_slice(light);
            let first = part * LANES;
            let bytes = exposed(&lights, sensor, levels, noise, (y * width + first) as u64);
            for (i, pixel) in pixels.chunks_exact_mut(3).enumerate().filter(|(i, _)| !in_field[first + i][2].is_nan()) {
                pixel.copy_from_slice(&[0, 1, 2].map(|channel| bytes[channel][i]));
            }
        }
    });
    image
}

/// The bytes of pixels side by side, of which the first has this number, by the instructions of this machine: the same on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn exposed(lights: &[Rgb; LANES], sensor: Sensor, levels: &[f32], noise: u64, first: u64) -> [[u8; LANES]; 3] {
    let [read, shot, gain] = sensor;
    let (mut bytes, mut hashes) = ([[0; LANES]; 3], [0; LANES]);
    for (hash, number) in hashes.iter_mut().zip(first..) {
        *hash = mix64(noise ^ number);
    }
    for (channel, bytes) in bytes.iter_mut().enumerate() {
        let (mut steps, mut shown, mut normals) = ([0_u32; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            hashes[i] = mix64(hashes[i]);
            normals[i] = normal(hashes[i]);
            let root = (gain * lights[i][channel]).clamp(0.0, 1.0).sqrt();
            steps[i] = (root * LEVEL_STEPS as f32 + 0.5) as u32;
        }
        for i in 0..LANES {
            shown[i] = levels[steps[i] as usize];
        }
        for i in 0..LANES {
            let sigma = (read * read + shot * shot * shown[i] * (1.0 / 255.0)).sqrt();
            // Adding a half and cutting rounds; below 0 it is 0.
            bytes[i] = (shown[i] + sigma * normals[i] + 0.5) as u8;
        }
    }
    bytes
}

/// A number of mean 0 and variance 1 from a hash: how many of its bits are set, with a uniform number between two such counts. Its excess
/// kurtosis is -1/32.
#[inline(always)]
fn normal(hash: u64) -> f32 {
    const BITS_MEAN: f32 = 32.0;
    // The variance of 64 fair bits, and that of the uniform number.
    const VARIANCE: f32 = 16.0 + 1.0 / 12.0;
    let between = (mix64(!hash) >> 40) as f32 / 16_777_216.0 - 0.5;
    (hash.count_ones() as f32 - BITS_MEAN + between) / VARIANCE.sqrt()
}
