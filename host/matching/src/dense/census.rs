//! The census transform: one bit per neighbour of a pixel, invariant to any monotonic change of brightness.
//!
//! R. Zabih and J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::plane::Plane;
use crate::pool::memory;

/// Reach of the window along rows and columns: 9 × 7 pixels, whose 62 neighbours fit into 64 bits.
pub(super) const REACH: [usize; 2] = [4, 3];
/// Number of pixels along a row of the window.
const SPAN: usize = 2 * REACH[0] + 1;
/// Expected number of different bits of two unrelated neighbourhoods.
pub(super) const UNRELATED: u8 = 31;

/// Number of rows that a thread takes at a time.
const BAND: usize = 32;

/// Computes one word per pixel, with a bit set for every darker neighbour. The border is repeated outwards.
pub(super) fn census(plane: &Plane) -> Vec<u64> {
    let (width, height) = (plane.width(), plane.height());
    let mut words = memory(plane.values().len());
    words.par_chunks_mut(width * BAND).enumerate().for_each(|(band, words)| {
        let first = band * BAND;
        words.fill(0);
        // Row y of the image is row y - first + the reach here.
        let rows: Vec<Vec<f32>> = (first..first + words.len() / width + 2 * REACH[1])
            .map(|y| padded(plane.row(y.saturating_sub(REACH[1]).min(height - 1))))
            .collect();
        for (words, rows) in words.chunks_exact_mut(width).zip(rows.windows(2 * REACH[1] + 1)) {
            let centre = &rows[REACH[1]][REACH[0]..][..width];
            rows.iter().enumerate().for_each(|(j, row)| set_bits(words, centre, row, j * SPAN));
        }
    });
    words
}

fn padded(row: &[f32]) -> Vec<f32> {
    (0..row.len() + 2 * REACH[0]).map(|i| row[i.saturating_sub(REACH[0]).min(row.len() - 1)]).collect()
}

/// Sets the bits of one row of all windows, the first one in place `bit`. The pixel itself is no darker than itself.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn set_bits(words: &mut [u64], centre: &[f32], row: &[f32], bit: usize) {
    let width = words.len();
    let (centre, near): (_, [&[f32]; SPAN]) = (&centre[..width], std::array::from_fn(|i| &row[i..][..width]));
    for x in 0..width {
        let mut bits = 0_u32;
        for (i, near) in near.iter().enumerate() {
            bits |= if near[x] < centre[x] { 1 << i } else { 0 };
        }
        words[x] |= u64::from(bits) << bit;
    }
}
