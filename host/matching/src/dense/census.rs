//! The census transform: one bit per neighbour of a pixel, invariant to any monotonic change of brightness.
//!
//! R. Zabih and J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::plane::Plane;

/// Reach of the window along rows and columns: 9 × 7 pixels, whose 62 neighbours fit into 64 bits.
pub(super) const REACH: [usize; 2] = [4, 3];
/// Expected number of different bits of two unrelated neighbourhoods.
pub(super) const UNRELATED: u8 = 31;

/// Computes one word per pixel, with a bit set for every darker neighbour. The border is repeated outwards.
pub(super) fn census(plane: &Plane) -> Vec<u64> {
    let mut words = vec![0; plane.values().len()];
    words.par_chunks_mut(plane.width()).enumerate().for_each(|(y, out)| {
        let centre = plane.row(y);
        let mut bit = 0;
        for j in 0..=2 * REACH[1] {
            let row = padded(plane.row((y + j).saturating_sub(REACH[1]).min(plane.height() - 1)));
            for i in (0..=2 * REACH[0]).filter(|&i| i != REACH[0] || j != REACH[1]) {
                set_bits(out, centre, &row[i..], bit);
                bit += 1;
            }
        }
    });
    words
}

fn padded(row: &[f32]) -> Vec<f32> {
    (0..row.len() + 2 * REACH[0]).map(|i| row[i.saturating_sub(REACH[0]).min(row.len() - 1)]).collect()
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn set_bits(words: &mut [u64], centre: &[f32], neighbours: &[f32], bit: u32) {
    for ((word, centre), neighbour) in words.iter_mut().zip(centre).zip(neighbours) {
        *word |= u64::from(neighbour < centre) << bit;
    }
}
