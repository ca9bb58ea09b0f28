//! Sampling of an 8-bit image at places that are known already.

use multiversion::multiversion;

use crate::plane::cubic_weights;
use crate::view_map::{Places, UNSEEN};

/// Pixels of a view that are sampled at once.
const TOGETHER: usize = 32;
/// The first of the pixels around a place is the first of four in each of four rows.
const TAPS: usize = 4;

/// Samples an image, given with its width, at the `places` of a row by cubic convolution (R. Keys, "Cubic convolution interpolation for digital image
/// processing", ASSP 29(6), 1981), and says which of them the camera sees. Pixels that it does not see are black.
///
/// Each place finds the pixels around it, and all are weighted down their columns and along their rows. Loops that compute many at once have no branches:
/// only then do compilers turn them into vector instructions.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
pub(crate) fn sample_line((image, width): (&[u8], usize), places: &Places, seen: &mut [bool], values: &mut [f32]) {
    let Some(reach) = image.len().checked_sub((TAPS - 1) * width) else {
        seen.fill(false);
        return values.fill(0.0);
    };
    let rows: [&[u8]; TAPS] = [0, 1, 2, 3].map(|row| &image[row * width..][..reach]);
    let chunks = values.chunks_mut(TOGETHER).zip(seen.chunks_mut(TOGETHER)).enumerate();
    for (chunk, (values, seen)) in chunks {
        let from = chunk * TOGETHER;
        let firsts = &places.firsts[from..][..values.len()];
        seen.iter_mut().zip(firsts).for_each(|(seen, first)| *seen = *first != UNSEEN);
        if firsts.iter().all(|first| *first == UNSEEN) {
            values.fill(0.0);
            continue;
        }
        let mut past = [[0.0_f32; TOGETHER]; 2];
        past[0][..values.len()].copy_from_slice(&places.past[0][from..][..values.len()]);
        past[1][..values.len()].copy_from_slice(&places.past[1][from..][..values.len()]);
        let mut taps = [[0_u32; TOGETHER]; TAPS];
        gather(rows, firsts, &mut taps);
        let found = weighed(&taps, &past);
        for ((value, found), seen) in values.iter_mut().zip(found).zip(seen) {
            *value = if *seen { found } else { 0.0 };
        }
    }
}

/// The pixels around places, four of a row in a number: those from each of `firsts` on, in each of `rows`, which are equally long. What is not seen has any.
///
/// A function of its own, whose few values stay in registers: reading pixels takes half of the time of sampling.
#[inline(never)]
fn gather(rows: [&[u8]; TAPS], firsts: &[u32], taps: &mut [[u32; TOGETHER]; TAPS]) {
    let reach = rows[0].len();
    let Some(last) = reach.checked_sub(TAPS) else { return };
    // The compiler sees that they are, and that one bound serves all.
    let [one, two, three, four] = rows.map(|row| &row[..reach]);
    let [to_one, to_two, to_three, to_four] = taps;
    let to = to_one.iter_mut().zip(to_two).zip(to_three).zip(to_four);
    for (first, (((to_one, to_two), to_three), to_four)) in firsts.iter().zip(to) {
        let first = (*first as usize).min(last);
        let found = |row: &[u8]| u32::from_le_bytes(row[first..].first_chunk().copied().unwrap_or_default());
        (*to_one, *to_two, *to_three, *to_four) = (found(one), found(two), found(three), found(four));
    }
}

/// The values at places `past` the second column and row of their `taps`, four of a row in a number.
#[inline(always)]
fn weighed(taps: &[[u32; TOGETHER]; TAPS], past: &[[f32; TOGETHER]; 2]) -> [f32; TOGETHER] {
    let (mut across, mut down) = ([[0.0_f32; TOGETHER]; TAPS], [[0.0_f32; TOGETHER]; TAPS]);
    for i in 0..TOGETHER {
        let (by_column, by_row) = (cubic_weights(past[0][i]), cubic_weights(past[1][i]));
        (across[0][i], across[1][i], across[2][i], across[3][i]) =
            (by_column[0], by_column[1], by_column[2], by_column[3]);
        (down[0][i], down[1][i], down[2][i], down[3][i]) = (by_row[0], by_row[1], by_row[2], by_row[3]);
    }
    let mut mixed = [[0.0_f32; TOGETHER]; TAPS];
    for (k, mixed) in mixed.iter_mut().enumerate() {
        let shift = 8 * k as u32;
        for i in 0..TOGETHER {
            let level = |taps: u32| (taps >> shift & 255) as i32 as f32;
            mixed[i] = down[0][i] * level(taps[0][i])
                + down[1][i] * level(taps[1][i])
                + down[2][i] * level(taps[2][i])
                + down[3][i] * level(taps[3][i]);
        }
    }
    let mut sums = [0.0_f32; TOGETHER];
    for i in 0..TOGETHER {
        sums[i] = across[0][i] * mixed[0][i]
            + across[1][i] * mixed[1][i]
            + across[2][i] * mixed[2][i]
            + across[3][i] * mixed[3][i];
    }
    sums
}
