//! Hashes, and smooth noise that never repeats within a room.

use crate::real::Real;

/// Ratio of the amplitudes of an octave and the next coarser one.
const PERSISTENCE: f32 = 0.72;

/// Mixes 32 bits so that each output bit depends on all input bits (the finaliser of MurmurHash3, A. Appleby 2011).
#[inline(always)]
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
#[inline(always)]
pub fn cell_hash(x: i32, y: i32, seed: u32) -> u32 {
    mix(x.cast_unsigned().wrapping_mul(0x8da6_b343) ^ mix(y.cast_unsigned().wrapping_add(seed)))
}

/// A fraction in [0, 1) from the bits of `hash`. `salt` selects one of many independent fractions.
#[inline(always)]
pub fn fraction(hash: u32, salt: u32) -> f32 {
    (mix(hash ^ salt.wrapping_mul(0x9e37_79b9)) >> 8) as f32 / 16_777_216.0
}

/// 0 below `low`, 1 above `high`, smooth between.
#[inline(always)]
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Share of the contrast of a feature of size `cell` that remains after averaging over `footprint` (both mm): all of it
/// with two or more samples in a cell, none with one, where the sampling theorem would be violated.
#[inline(always)]
pub fn survival<T: Real>(cell: f64, footprint: T) -> f32 {
    (T::of(2.0) - T::of(2.0) * footprint / T::of(cell)).single().clamp(0.0, 1.0)
}

/// Value noise from -1 to 1 with one random value per unit cell, interpolated by quintics (K. Perlin, "Improving
/// noise", SIGGRAPH 2002, eq. 1), at each of the points.
#[inline(always)]
pub fn value_noise<T: Real, const N: usize>(p: &[[T; N]; 3], seeds: &[u32; N]) -> [f32; N] {
    let (mut cells, mut shares) = ([[0_u32; N]; 3], [[0.0_f32; N]; 3]);
    for axis in 0..3 {
        for i in 0..N {
            let (cell, share) = p[axis][i].split();
            (cells[axis][i], shares[axis][i]) = (cell.cast_unsigned(), share);
        }
    }
    blended(&cells, &shares, seeds)
}

/// The noise at places in cells of a unit, by their shares of the way across them.
#[inline(always)]
fn blended<const N: usize>(cells: &[[u32; N]; 3], shares: &[[f32; N]; 3], seeds: &[u32; N]) -> [f32; N] {
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
pub fn octaves<T: Real, const N: usize>(
    p: &[[T; N]; 3],
    cell: f64,
    count: u32,
    seeds: &[u32; N],
    footprints: &[T; N],
) -> [f32; N] {
    let (mut sum, mut amplitude, mut cell, mut p) = ([0.0; N], 0.75, cell, *p);
    for octave in 0..count {
        let (mut weights, mut shown) = ([0.0; N], false);
        for i in 0..N {
            weights[i] = survival(cell, footprints[i]);
            shown |= weights[i] > 0.0;
        }
        if !shown {
            break;
        }
        let (mut scaled, mut seeds) = (p, *seeds);
        let per_mm = T::of(1.0 / cell);
        scaled.as_flattened_mut().iter_mut().for_each(|component| *component = *component * per_mm);
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
fn turned<T: Real, const N: usize>([x, y, z]: &[[T; N]; 3]) -> [[T; N]; 3] {
    // Columns of an exact rational rotation: (2, -1, 2), (2, 2, -1), (-1, 2, 2) over 3.
    let (two, third) = (T::of(2.0), T::of(1.0 / 3.0));
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
    use crate::packet::singles;

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
    fn single_precision_gives_the_exact_noise() {
        for i in 0..2000 {
            let p = [f64::from(i) * 1.37 - 1500.0, f64::from(i) * 0.91, f64::from(i) * -0.45].map(|p| [p]);
            let exact = octaves(&p, 64.0, 6, &[9], &[2.5]);
            let quick = octaves(&singles(&p), 64.0, 6, &[9], &[2.5_f32]);
            assert!((exact[0] - quick[0]).abs() < 1e-3, "{exact:?} is not {quick:?} at {p:?}");
        }
    }
}
