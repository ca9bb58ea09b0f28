//! The choice of the best hypothesis for every pixel, and its check from the right view.

use multiversion::multiversion;
use rayon::prelude::*;

use super::volume::Hypotheses;

/// Largest difference between the choices of the left and the right view, in hypotheses.
const TOLERANCE: i32 = 1;

/// Chooses the disparity of each pixel, in pixels; NaN where there is none, or where the views disagree. `seen` states
/// where the left and the right camera see whole windows.
pub(super) fn winners(sums: &[u16], seen: [&[bool]; 2], hypotheses: &Hypotheses) -> Vec<f32> {
    let Hypotheses { width, count, ref first, .. } = *hypotheses;
    let mut disparities = vec![f32::NAN; first.len()];
    disparities.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let row = y * width..(y + 1) * width;
        let (sums, first) = (&sums[y * width * count..(y + 1) * width * count], &first[row.clone()]);
        let [left, right] = seen.map(|seen| &seen[row.clone()]);
        let by_right = chosen_by_right(sums, first, count);
        for (x, out) in out.iter_mut().enumerate().filter(|(x, _)| left[*x]) {
            let cell = &sums[x * count..(x + 1) * count];
            let best = least(cell);
            let disparity = first[x] + best as i32;
            let Some(partner) = usize::try_from(x as i32 - disparity).ok().filter(|&partner| partner < width) else {
                continue;
            };
            let agreed = (by_right[partner] - disparity).abs() <= TOLERANCE;
            if right[partner] && agreed && best > 0 && best + 1 < count {
                *out = disparity as f32 + vertex([cell[best - 1], cell[best], cell[best + 1]].map(f32::from));
            }
        }
    });
    disparities
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn least(cell: &[u16]) -> usize {
    let smallest = cell.iter().copied().fold(u16::MAX, u16::min);
    cell.iter().position(|&sum| sum == smallest).unwrap_or(0)
}

/// The minimum of the parabola through three sums at -1, 0, 1.
fn vertex([before, at, after]: [f32; 3]) -> f32 {
    let curvature = before + after - 2.0 * at;
    if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 }
}

/// The disparity with the least sum for each pixel of the right row, among the left pixels that map to it.
fn chosen_by_right(sums: &[u16], first: &[i32], count: usize) -> Vec<i32> {
    let width = first.len();
    // In reverse order the index grows with the disparity; margins take partners beyond the row.
    let margin = count;
    let mut best = vec![u32::MAX; width + 2 * margin];
    for (x, (cell, &first)) in sums.chunks_exact(count).zip(first).enumerate() {
        let at = (margin + width - 1 - x) as i64 + i64::from(first);
        let at = at.clamp(0, (width + margin) as i64) as usize;
        offer(&mut best[at..at + count], cell, first);
    }
    (0..width).map(|x| (best[margin + width - 1 - x] & 0xFFFF) as i32 - BIAS).collect()
}

/// Offset that makes disparities positive, to store them with the sum in one word.
const BIAS: i32 = 0x4000;

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn offer(best: &mut [u32], cell: &[u16], first: i32) {
    let mut disparity = (first + BIAS) as u32;
    for (best, &sum) in best.iter_mut().zip(cell) {
        *best = (*best).min((u32::from(sum) << 16) | disparity);
        disparity = disparity.wrapping_add(1);
    }
}
