//! The noise of [`crate::texture_noise`] in single precision: the same cells and values, to far less than a grey level.

use crate::packet::Singles;
use crate::texture_noise::{PERSISTENCE, blended, survival, turned};

/// [`crate::texture_noise::octaves`] in single precision; `footprints` that are not numbers count as so large that nothing is seen.
#[inline(always)]
pub fn octaves<const N: usize>(
    p: &Singles<N>,
    cell: f64,
    count: u32,
    seeds: &[u32; N],
    footprints: &[f64; N],
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
        let (mut seeds, per_mm) = (*seeds, (1.0 / cell) as f32);
        seeds.iter_mut().for_each(|seed| *seed = seed.wrapping_add(octave.wrapping_mul(0x632b_e5ab)));
        let noise = value_noise(&p, per_mm, &seeds);
        for i in 0..N {
            sum[i] += amplitude * weights[i] * noise[i];
        }
        amplitude *= PERSISTENCE;
        cell *= 0.5;
        p = turned(&p);
    }
    sum
}

/// Splits a number below 2^22 into whole cells and the rest.
#[inline(always)]
fn split(x: f32) -> (u32, f32) {
    // 1.5 times 2^23: added to a number of that size it leaves the nearest whole one in the last bits.
    const TO_WHOLE: f32 = 12_582_912.0;
    let nearest = (x + TO_WHOLE) - TO_WHOLE;
    let whole = nearest - if nearest > x { 1.0 } else { 0.0 };
    ((whole + TO_WHOLE).to_bits().wrapping_sub(TO_WHOLE.to_bits()), x - whole)
}

#[inline(always)]
fn value_noise<const N: usize>(p: &Singles<N>, per_mm: f32, seeds: &[u32; N]) -> [f32; N] {
    let (mut cells, mut shares) = ([[0_u32; N]; 3], [[0.0_f32; N]; 3]);
    for axis in 0..3 {
        for i in 0..N {
            (cells[axis][i], shares[axis][i]) = split(p[axis][i] * per_mm);
        }
    }
    blended(&cells, &shares, seeds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packet::singles;

    #[test]
    fn single_precision_gives_the_exact_noise() {
        for i in 0..2000 {
            let p = [f64::from(i) * 1.37 - 1500.0, f64::from(i) * 0.91, f64::from(i) * -0.45].map(|p| [p]);
            let exact = crate::texture_noise::octaves(&p, 64.0, 6, &[9], &[2.5]);
            let quick = octaves(&singles(&p), 64.0, 6, &[9], &[2.5]);
            assert!((exact[0] - quick[0]).abs() < 1e-3, "{exact:?} is not {quick:?} at {p:?}");
        }
    }
}
