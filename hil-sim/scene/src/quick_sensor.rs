//! The image that lens and sensor make of light, for images in real time.

use std::sync::LazyLock;

use image::RgbImage;
use multiversion::multiversion;
use rayon::prelude::*;

use crate::Optics;
use crate::optics::encoded;
use crate::packet::{QUICK_LANES, Singles};
use crate::quick::RayTable;
use crate::quick_canvas::Canvas;
use crate::quick_spread::{Spread, SpreadRows};
use crate::texture_noise::mix;

/// The grey level of light, 0 to 1, before noise, at steps of its square root.
static LEVELS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=LEVEL_STEPS).map(|step| (255.0 * encoded((step as f64 / LEVEL_STEPS as f64).powi(2))) as f32).collect()
});
const LEVEL_STEPS: usize = 4096;

/// Read noise, shot noise and gain: as in [`Optics`].
type Sensor = [f32; 3];

/// The image that lens and sensor make of the light on a canvas; black outside the field.
pub fn develop(canvas: &Canvas, table: &RayTable, optics: &Optics, noise: u64) -> RgbImage {
    let width = table.size.width as usize;
    let sensor = [optics.read_noise, optics.shot_noise, optics.gain].map(|value| value.max(0.0) as f32);
    let (levels, spread): (&[f32], _) = (&LEVELS, Spread::new(optics.blur_px, &table.spots));
    let mut image = RgbImage::new(table.size.width, table.size.height);
    let rows = image.par_chunks_exact_mut(3 * width).enumerate();
    rows.for_each_init(<[SpreadRows; 3]>::default, |spread_rows, (y, row)| {
        for (channel, rows) in spread_rows.iter_mut().enumerate() {
            spread.row((canvas, &table.exposures), (channel, y), &table.spots[y * width..], rows);
        }
        let in_field = &table.rays[2][(y + 1) * (width + 2) + 1..][..width];
        for (part, pixels) in row.chunks_mut(3 * QUICK_LANES).enumerate() {
            let (first, count) = (part * QUICK_LANES, pixels.len() / 3);
            let mut lights = [[0.0; QUICK_LANES]; 3];
            for (lights, rows) in lights.iter_mut().zip(&*spread_rows) {
                lights[..count].copy_from_slice(&rows.light[first..first + count]);
            }
            let bytes = exposed(&lights, sensor, levels, noise, (y * width + first) as u32);
            for ((i, pixel), ray) in pixels.chunks_exact_mut(3).enumerate().zip(&in_field[first..]) {
                pixel.copy_from_slice(if ray.is_nan() { &[0; 3] } else { &bytes[i] });
            }
        }
    });
    image
}

/// The bytes of pixels side by side, of which the first has this number, by the instructions of this machine: the same on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn exposed(
    lights: &Singles<QUICK_LANES>,
    sensor: Sensor,
    levels: &[f32],
    noise: u64,
    first: u32,
) -> [[u8; 3]; QUICK_LANES] {
    let [read, shot, gain] = sensor;
    let (mut bytes, mut hashes) = ([[0; 3]; QUICK_LANES], [0; QUICK_LANES]);
    for (hash, number) in hashes.iter_mut().zip(first..) {
        *hash = mix(number ^ noise as u32) ^ (noise >> 32) as u32;
    }
    for (channel, lights) in lights.iter().enumerate() {
        let (mut steps, mut shown, mut normals) = ([0_u32; QUICK_LANES], [0.0; QUICK_LANES], [0.0; QUICK_LANES]);
        for i in 0..QUICK_LANES {
            normals[i] = normal(hashes[i], channel as u32);
            let root = (gain * lights[i]).clamp(0.0, 1.0).sqrt();
            steps[i] = (root * LEVEL_STEPS as f32 + 0.5) as u32;
        }
        for (shown, step) in shown.iter_mut().zip(&steps) {
            *shown = levels[*step as usize];
        }
        for i in 0..QUICK_LANES {
            let sigma = (read * read + shot * shot * shown[i] * (1.0 / 255.0)).sqrt();
            // Adding a half and cutting rounds; below 0 it is 0.
            bytes[i][channel] = (shown[i] + sigma * normals[i] + 0.5) as u8;
        }
    }
    bytes
}

/// A number of mean 0 and variance 1 from a hash and the number of a channel: how many of 64 hashed bits are set, with a uniform number
/// between two such counts. Its excess kurtosis is -1/32.
#[inline(always)]
fn normal(hash: u32, channel: u32) -> f32 {
    const BITS_MEAN: f32 = 32.0;
    // The variance of 64 fair bits, and that of the uniform number.
    const VARIANCE: f32 = 16.0 + 1.0 / 12.0;
    let salt = channel.wrapping_mul(0x9e37_79b9);
    let (low, high) = (mix(hash.wrapping_add(salt)), mix(hash.wrapping_add(salt) ^ 0x6a09_e667));
    let between = ((low ^ high.rotate_left(16)).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / 16_777_216.0 - 0.5;
    ((low.count_ones() + high.count_ones()) as f32 - BITS_MEAN + between) / VARIANCE.sqrt()
}
