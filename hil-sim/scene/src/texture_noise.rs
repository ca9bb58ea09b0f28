//! Hashes, and smooth noise that never repeats within a room.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::packet::Triples;

/// Ratio of the amplitudes of an octave and the next coarser one.
pub const PERSISTENCE: f32 = 0.72;

/// Mixes 32 bits so that each output bit depends on all input bits (the finaliser of MurmurHash3, A. Appleby 2011).
pub fn mix(mut h: u32) -> u32 {
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// Mixes 64 bits (SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
#[inline(always)]
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

/// Splits a number below 2^31 into whole cells and the rest.
#[inline(always)]
pub fn split(x: f64) -> (i32, f32) {
    // 1.5 times 2^52: added to a number of that size it leaves the nearest whole one in the last bits.
    const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
    let nearest = (x + TO_WHOLE) - TO_WHOLE;
    let whole = nearest - if nearest > x { 1.0 } else { 0.0 };
    ((whole + TO_WHOLE).to_bits() as i32, (x - whole) as f32)
}

/// 0 below `low`, 1 above `high`, smooth between.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Share of the contrast of a feature of size `cell` that remains after averaging over `footprint` (both mm): all of it
/// with two or more samples in a cell, none with one, where the sampling theorem would be violated.
#[inline(always)]
pub fn survival(cell: f64, footprint: f64) -> f32 {
    (2.0 - 2.0 * footprint / cell).clamp(0.0, 1.0) as f32
}

/// Value noise from -1 to 1 with one random value per unit cell, interpolated by quintics (K. Perlin, "Improving
/// noise", SIGGRAPH 2002, eq. 1), at each of the points.
#[inline(always)]
pub fn value_noise<const N: usize>(p: &Triples<N>, seeds: &[u32; N]) -> [f32; N] {
    let (mut cells, mut shares) = ([[0_u32; N]; 3], [[0.0_f32; N]; 3]);
    for axis in 0..3 {
        for i in 0..N {
            let (cell, share) = split(p[axis][i]);
            (cells[axis][i], shares[axis][i]) = (cell.cast_unsigned(), share);
        }
    }
    blended(&cells, &shares, seeds)
}

/// The noise at places in cells of a unit, by their shares of the way across them.
#[inline(always)]
pub fn blended<const N: usize>(cells: &[[u32; N]; 3], shares: &[[f32; N]; 3], seeds: &[u32; N]) -> [f32; N] {
    let mut cells = *cells;
    for (cells, strand) in cells.iter_mut().zip(STRANDS) {
        cells.iter_mut().for_each(|cell| *cell = cell.wrapping_mul(strand));
    }
    let mut noise = [0.0; N];
    for i in 0..N {
        let [fx, fy, fz] = [fade(shares[0][i]), fade(shares[1][i]), fade(shares[2][i])];
        let [x, y, z] = [cells[0][i], cells[1][i], cells[2][i] ^ seeds[i]];
        let (next_x, next_y) = (x.wrapping_add(STRANDS[0]), y.wrapping_add(STRANDS[1]));
        let next_z = cells[2][i].wrapping_add(STRANDS[2]) ^ seeds[i];
        let near = lerp(edge([x, next_x], y ^ z, fx), edge([x, next_x], next_y ^ z, fx), fy);
        let far = lerp(edge([x, next_x], y ^ next_z, fx), edge([x, next_x], next_y ^ next_z, fx), fy);
        noise[i] = lerp(near, far, fz) * (2.0 / 4_294_967_296.0) - 1.0;
    }
    noise
}

/// What the hashes of neighbouring cells differ by before they are mixed, along each axis.
const STRANDS: [u32; 3] = [0x8da6_b343, 0xd816_3841, 0xcb1a_b31f];

#[inline(always)]
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[inline(always)]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The value between two corners of a cell that share the hash `other` of their other axes.
#[inline(always)]
fn edge([low, high]: [u32; 2], other: u32, share: f32) -> f32 {
    lerp(scrambled(low ^ other) as f32, scrambled(high ^ other) as f32, share)
}

/// One round less than [`mix`]: the weak low bits do not matter for noise.
#[inline(always)]
const fn scrambled(h: u32) -> u32 {
    let h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35)
}

/// Noise of `count` octaves, about -1 to 1; the coarsest has cells of `cell` mm, each next one half that. Octaves finer
/// than the `footprints` (mm) fade out.
///
/// Without fused operations every set of instructions gives the same bits.
#[inline(always)]
pub fn octaves<const N: usize>(
    p: &Triples<N>,
    cell: f64,
    count: u32,
    seeds: &[u32; N],
    footprints: &[f64; N],
) -> [f32; N] {
    let (mut sum, mut amplitude, mut cell, mut p) = ([0.0; N], 0.75, cell, *p);
    for octave in 0..count {
        let mut weights = [0.0; N];
        for i in 0..N {
            weights[i] = survival(cell, footprints[i]);
        }
        if weights.iter().all(|weight| *weight <= 0.0) {
            break;
        }
        let (mut scaled, mut seeds) = (p, *seeds);
        let per_mm = 1.0 / cell;
        scaled.as_flattened_mut().iter_mut().for_each(|component| *component *= per_mm);
        seeds.iter_mut().for_each(|seed| *seed = seed.wrapping_add(octave.wrapping_mul(0x632b_e5ab)));
        let noise = value_noise(&scaled, &seeds);
        for i in 0..N {
            sum[i] += amplitude * weights[i] * noise[i];
        }
        amplitude *= PERSISTENCE;
        cell *= 0.5;
        p = turned(&p);
    }
    sum
}

/// Turns the lattice between octaves, so that its axes do not show, in the precision of its numbers.
#[inline(always)]
pub fn turned<T, const N: usize>([x, y, z]: &[[T; N]; 3]) -> [[T; N]; 3]
where
    T: Copy + From<f32> + Add<Output = T> + Sub<Output = T> + Mul<Output = T> + Div<Output = T> + Neg<Output = T>,
{
    // Columns of an exact rational rotation: (2, -1, 2), (2, 2, -1), (-1, 2, 2) over 3.
    let (two, third) = (T::from(2.0), T::from(1.0) / T::from(3.0));
    let mut turned = [*x; 3];
    for i in 0..N {
        turned[0][i] = (two * x[i] + two * y[i] - z[i]) * third;
        turned[1][i] = (-x[i] + two * y[i] + two * z[i]) * third;
        turned[2][i] = (two * x[i] - y[i] + two * z[i]) * third;
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_noise_is_continuous_and_bounded() {
        for i in 0..2000 {
            let at =
                |off: f64| [f64::from(i) * 0.37 - 300.0, f64::from(i) * 0.11, -f64::from(i) * 0.05].map(|p| [p + off]);
            let ([here], [near]) = (value_noise(&at(0.0), &[5]), value_noise(&at(1e-6), &[5]));
            assert!(here.abs() <= 1.0 && (here - near).abs() < 1e-4);
        }
    }

    #[test]
    fn a_number_splits_into_its_floor_and_the_rest() {
        for (x, whole, rest) in
            [(2.75, 2, 0.75), (-2.75, -3, 0.25), (0.0, 0, 0.0), (-7.0, -7, 0.0), (0.5, 0, 0.5), (1.5, 1, 0.5)]
        {
            assert_eq!(split(x), (whole, rest), "{x}");
        }
    }
}
