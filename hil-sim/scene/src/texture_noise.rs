//! Hashes, and smooth noise that never repeats within a room.

use multiversion::multiversion;
use nalgebra::Vector3;

/// Ratio of the amplitudes of an octave and the next coarser one.
const PERSISTENCE: f32 = 0.72;

/// Mixes 32 bits so that each output bit depends on all input bits (the finaliser of MurmurHash3, A. Appleby 2011).
pub fn mix(mut h: u32) -> u32 {
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// Mixes 64 bits (SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
pub fn mix64(mut h: u64) -> u64 {
    h = h.wrapping_add(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^ (h >> 31)
}

/// A hash of a cell of a plane.
pub fn cell_hash(x: i32, y: i32, seed: u32) -> u32 {
    mix(x.cast_unsigned().wrapping_mul(0x8da6_b343) ^ mix(y.cast_unsigned().wrapping_add(seed)))
}

/// A fraction in [0, 1) from the bits of `hash`. `salt` selects one of many independent fractions.
pub fn fraction(hash: u32, salt: u32) -> f32 {
    (mix(hash ^ salt.wrapping_mul(0x9e37_79b9)) >> 8) as f32 / 16_777_216.0
}

/// Splits a number into whole cells and the rest.
#[inline(always)]
pub fn split(x: f64) -> (i32, f32) {
    let towards_zero = x as i32;
    let whole = towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > x));
    (whole, (x - f64::from(whole)) as f32)
}

/// 0 below `low`, 1 above `high`, smooth between.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Share of the contrast of a feature of size `cell` that remains after averaging over `footprint` (both mm): all of it
/// with two or more samples in a cell, none with one, where the sampling theorem would be violated.
pub fn survival(cell: f64, footprint: f64) -> f32 {
    (2.0 - 2.0 * footprint / cell).clamp(0.0, 1.0) as f32
}

/// Value noise from -1 to 1 with one random value per unit cell, interpolated by quintics (K. Perlin, "Improving
/// noise", SIGGRAPH 2002, eq. 1).
#[inline(always)]
pub fn value_noise(p: Vector3<f64>, seed: u32) -> f32 {
    let ((x, fx), (y, fy), (z, fz)) = (split(p.x), split(p.y), split(p.z));
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (fx, fy, fz) = (fade(fx), fade(fy), fade(fz));
    let strand = |i: i32, factor: u32| {
        let low = i.cast_unsigned().wrapping_mul(factor);
        [low, low.wrapping_add(factor)]
    };
    // One round less than `mix`: the weak low bits do not matter here.
    let scramble = |h: u32| {
        let h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35)
    };
    let (hx, hy, hz) = (strand(x, 0x8da6_b343), strand(y, 0xd816_3841), strand(z, 0xcb1a_b31f));
    // All eight corners at once: the compiler makes vector instructions of it.
    let values: [f32; 8] =
        std::array::from_fn(|n| hx[n & 1] ^ hy[n >> 1 & 1] ^ hz[n >> 2] ^ seed).map(|h| scramble(h) as f32);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edges: [f32; 4] = std::array::from_fn(|n| lerp(values[2 * n], values[2 * n + 1], fx));
    let faces: [f32; 2] = std::array::from_fn(|n| lerp(edges[2 * n], edges[2 * n + 1], fy));
    lerp(faces[0], faces[1], fz) * (2.0 / 4_294_967_296.0) - 1.0
}

/// Noise of `count` octaves, about -1 to 1; the coarsest has cells of `cell` mm, each next one half that. Octaves finer
/// than `footprint` (mm) fade out.
///
/// Without fused operations every set of instructions gives the same bits.
#[multiversion(targets("x86_64+avx2"))]
pub fn octaves(p: Vector3<f64>, cell: f64, count: u32, seed: u32, footprint: f64) -> f32 {
    let (mut sum, mut amplitude, mut cell, mut p) = (0.0, 0.75, cell, p);
    for octave in 0..count {
        let weight = survival(cell, footprint);
        if weight <= 0.0 {
            break;
        }
        sum += amplitude * weight * value_noise(p / cell, seed.wrapping_add(octave.wrapping_mul(0x632b_e5ab)));
        amplitude *= PERSISTENCE;
        cell *= 0.5;
        p = turned(p);
    }
    sum
}

/// Turns the lattice between octaves, so that its axes do not show.
fn turned(p: Vector3<f64>) -> Vector3<f64> {
    // Columns of an exact rational rotation: (2, -1, 2), (2, 2, -1), (-1, 2, 2) over 3.
    Vector3::new(2.0 * p.x + 2.0 * p.y - p.z, -p.x + 2.0 * p.y + 2.0 * p.z, 2.0 * p.x - p.y + 2.0 * p.z) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_noise_is_continuous_and_bounded() {
        for i in 0..2000 {
            let p = Vector3::new(f64::from(i) * 0.37 - 300.0, f64::from(i) * 0.11, -f64::from(i) * 0.05);
            let here = value_noise(p, 5);
            let near = value_noise(p + Vector3::new(1e-6, 1e-6, 1e-6), 5);
            assert!(here.abs() <= 1.0 && (here - near).abs() < 1e-4);
        }
    }
}
