//! Semiglobal aggregation of costs along paths, so that neighbours agree unless the views contradict.
//!
//! H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 30(2), 2008, eq. 13:
//!
//! ```text
//! L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)        q before p on the path
//! ```
//!
//! The sum runs over four paths: along the row and the column, both ways.

use multiversion::multiversion;
use rayon::prelude::*;

use super::volume::Hypotheses;

/// Penalty of a step by one hypothesis, as on slanted surfaces.
const P1: u16 = 8;
/// Penalty of a larger step, as at edges of objects.
const P2: u16 = 60;
/// Number of columns processed together.
const STRIP: usize = 32;
/// Cost of a hypothesis that the neighbour did not try, larger than any true cost. Adding penalties does not overflow.
const UNTRIED: u16 = u16::MAX / 2;

/// Sums the path costs of every hypothesis, in the layout of `costs`.
pub(super) fn gathered(costs: &[u8], hypotheses: &Hypotheses) -> Vec<u16> {
    let Hypotheses { width, height, count, ref first } = *hypotheses;
    let volume = Volume { costs, first, count };
    let mut sums = vec![0; costs.len()];
    sums.par_chunks_mut(width * count).enumerate().for_each(|(y, sums)| {
        let mut path = Path::new(count);
        for x in there_and_back(width) {
            let Some(x) = x else {
                path.restart();
                continue;
            };
            path.advance(&volume, y * width + x, &mut sums[x * count..(x + 1) * count]);
        }
    });
    let mut strips: Vec<Vec<&mut [u16]>> = (0..width.div_ceil(STRIP)).map(|_| Vec::with_capacity(height)).collect();
    for row in sums.chunks_mut(width * count) {
        strips.iter_mut().zip(row.chunks_mut(STRIP * count)).for_each(|(strip, part)| strip.push(part));
    }
    strips.par_iter_mut().enumerate().for_each(|(strip, rows)| {
        let left = strip * STRIP;
        let mut paths: Vec<Path> = (left..width.min(left + STRIP)).map(|_| Path::new(count)).collect();
        for y in there_and_back(height) {
            let Some(y) = y else {
                paths.iter_mut().for_each(Path::restart);
                continue;
            };
            for (i, (path, sums)) in paths.iter_mut().zip(rows[y].chunks_exact_mut(count)).enumerate() {
                path.advance(&volume, y * width + left + i, sums);
            }
        }
    });
    sums
}

/// Counts from 0 to below `end` and, after `None`, back again.
fn there_and_back(end: usize) -> impl Iterator<Item = Option<usize>> {
    (0..end).map(Some).chain([None]).chain((0..end).rev().map(Some))
}

/// The volume of costs that the paths run through.
struct Volume<'a> {
    costs: &'a [u8],
    first: &'a [i32],
    count: usize,
}

/// The costs at the last pixel of a path, padded on both sides for hypotheses that it did not try.
struct Path {
    first: i32,
    /// Least cost at the last pixel; `None` before the first pixel.
    least: Option<u16>,
    last: Vec<u16>,
    next: Vec<u16>,
}

impl Path {
    fn new(count: usize) -> Self {
        let empty = vec![UNTRIED; 3 * count + 4];
        Self { first: 0, least: None, last: empty.clone(), next: empty }
    }

    fn restart(&mut self) {
        self.last.fill(UNTRIED);
        self.least = None;
    }

    /// Advances the path to a pixel and adds its costs there to `sums`.
    fn advance(&mut self, volume: &Volume<'_>, pixel: usize, sums: &mut [u16]) {
        let (count, room) = (volume.count, volume.count + 2);
        let first = volume.first[pixel];
        let most = room as i32 - 1;
        let from = (room as i32 - 1 + (first - self.first).clamp(-most, most)) as usize;
        // At its first pixel a path has the costs alone.
        let bounds = self.least.map_or([0, 0], |least| [least, least + P2]);
        let before = &self.last[from..from + count + 2];
        let costs = &volume.costs[pixel * count..(pixel + 1) * count];
        self.least = Some(step(costs, before, bounds, &mut self.next[room..room + count], sums));
        self.first = first;
        std::mem::swap(&mut self.last, &mut self.next);
    }
}

/// Computes one pixel of a path; returns its least cost.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
fn step(costs: &[u8], before: &[u16], [least, jump]: [u16; 2], here: &mut [u16], sums: &mut [u16]) -> u16 {
    let count = costs.len();
    let (below, same, above) = (&before[..count], &before[1..=count], &before[2..count + 2]);
    let (here, sums) = (&mut here[..count], &mut sums[..count]);
    let mut smallest = u16::MAX;
    for i in 0..count {
        let near = below[i].min(above[i]).saturating_add(P1);
        let cost = u16::from(costs[i]).wrapping_add(same[i].min(near).min(jump).wrapping_sub(least));
        here[i] = cost;
        sums[i] = sums[i].wrapping_add(cost);
        smallest = smallest.min(cost);
    }
    smallest
}
