//! The choice of the best hypothesis for every pixel, and its check from the right view.

use multiversion::multiversion;
use rayon::prelude::*;

use super::volume::Hypotheses;

/// Largest difference between the choices of the left and the right view, in hypotheses.
const TOLERANCE: i32 = 1;

/// Chooses the disparity of each pixel of some rows, the first of which and whose sums are given, in pixels; NaN where there is none, or where the views disagree.
/// `disparities` are those of all rows. `seen` states where the left and the right camera see whole windows.
pub(super) fn winners(
    disparities: &mut [f32],
    (top, sums): (usize, &[u8]),
    seen: [&[bool]; 2],
    hypotheses: &Hypotheses,
) {
    let Hypotheses { width, count, ref first, .. } = *hypotheses;
    let rows = disparities[top * width..].par_chunks_mut(width).zip(sums.par_chunks(width * count));
    rows.enumerate().for_each(|(y, (out, sums))| {
        let row = (top + y) * width..(top + y + 1) * width;
        chosen(out, sums, &first[row.clone()], seen.map(|seen| &seen[row.clone()]));
    });
}

/// Chooses the disparities of one row.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn chosen(out: &mut [f32], sums: &[u8], first: &[i32], [left, right]: [&[bool]; 2]) {
    out.fill(f32::NAN);
    let (width, count) = (out.len(), sums.len() / out.len().max(1));
    // In reverse order the index grows with the disparity; margins take partners beyond the row.
    let margin = count;
    let mut by_right = vec![u32::MAX; width + 2 * margin];
    for (x, (cell, &first)) in sums.chunks_exact(count).zip(first).enumerate().filter(|(x, _)| left[*x]) {
        let at = (margin + width - 1 - x) as i64 + i64::from(first);
        let at = at.clamp(0, (width + margin) as i64) as usize;
        offer(&mut by_right[at..at + count], cell, first);
    }
    for (x, out) in out.iter_mut().enumerate().filter(|(x, _)| left[*x]) {
        let cell = &sums[x * count..(x + 1) * count];
        let best = least(cell);
        let disparity = first[x] + best as i32;
        let Some(partner) = usize::try_from(x as i32 - disparity).ok().filter(|&partner| partner < width) else {
            continue;
        };
        let chosen_by_right = (by_right[margin + width - 1 - partner] & 0xFFFF) as i32 - BIAS;
        let agreed = (chosen_by_right - disparity).abs() <= TOLERANCE;
        if right[partner] && agreed && best > 0 && best + 1 < count {
            *out = disparity as f32 + vertex([cell[best - 1], cell[best], cell[best + 1]].map(f32::from));
        }
    }
}

/// The first hypothesis of the least sum.
#[inline(always)]
fn least(cell: &[u8]) -> usize {
    let least = cell.iter().fold(u8::MAX, |least, sum| least.min(*sum));
    cell.iter().position(|sum| *sum == least).unwrap_or_default()
}

/// The minimum of the parabola through three sums at -1, 0, 1.
#[inline(always)]
fn vertex([before, at, after]: [f32; 3]) -> f32 {
    let curvature = before + after - 2.0 * at;
    if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 }
}

/// Offset that makes disparities positive, to store them with the sum in one word.
const BIAS: i32 = 0x4000;

/// Offers the sums of a left pixel to the right pixels that are its partners: each keeps the least one with its disparity.
#[inline(always)]
fn offer(best: &mut [u32], cell: &[u8], first: i32) {
    let (best, disparity) = (&mut best[..cell.len()], (first + BIAS) as u32);
    for i in 0..cell.len() {
        best[i] = best[i].min((u32::from(cell[i]) << 16) | disparity.wrapping_add(i as u32));
    }
}
