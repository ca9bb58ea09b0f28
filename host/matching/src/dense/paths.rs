//! Semiglobal aggregation of costs along paths, so that neighbours agree unless the views contradict.
//!
//! H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 30(2), 2008, eq. 13:
//!
//! ```text
//! L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)        q before p on the path
//! ```
//!
//! The sum runs over four paths: along the row and the column, both ways.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::volume::{Costs, Hypotheses, LANES, memory};

/// Penalty of a step by one hypothesis, as on slanted surfaces.
const P1: u8 = 8;
/// Penalty of a larger step, as at edges of objects.
const P2: u8 = 60;
/// Number of columns processed together: the costs of a strip stay in the cache on the way there and back.
const STRIP: usize = 16;
/// Number of rows processed together: each pixel of a path waits for the one before, those of other paths do not.
const ROWS: usize = 4;
/// Cost of a hypothesis that the neighbour did not try, larger than any true cost: those are at most 62 + P2, and that of a jump 62 + 2 P2.
const UNTRIED: u8 = u8::MAX;

/// Sums the path costs of every hypothesis, by rows, pixels and hypotheses. Sums that would be larger are 255: where that is the least one, the
/// views have nothing in common. Paths begin and end with the columns of each row that the left camera sees: beyond them all hypotheses cost
/// the same, so that a path brings nothing from there.
pub(super) fn gathered(costs: &Costs<'_>) -> Vec<u8> {
    let Hypotheses { width, height, count, .. } = *costs.hypotheses();
    let mut sums = memory(width * height * count);
    sums.par_chunks_mut(ROWS * width * count).enumerate().for_each_init(Vec::new, |scratch, (block, sums)| {
        sums.fill(0);
        scratch.resize(sums.len(), 0);
        along_rows(costs, block * ROWS, scratch, sums);
    });
    let mut strips: Vec<Vec<&mut [u8]>> = (0..width.div_ceil(STRIP)).map(|_| Vec::with_capacity(height)).collect();
    for row in sums.chunks_mut(width * count) {
        strips.iter_mut().zip(row.chunks_mut(STRIP * count)).for_each(|(strip, part)| strip.push(part));
    }
    strips.par_iter_mut().enumerate().for_each_init(Vec::new, |scratch, (strip, rows)| {
        scratch.resize(height * STRIP * count, 0);
        along_columns(costs, strip * STRIP, scratch, rows);
    });
    sums
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
fn along_rows(costs: &Costs<'_>, top: usize, scratch: &mut [u8], sums: &mut [u8]) {
    match costs.hypotheses().count {
        LANES => rows::<Narrow>(costs, top, scratch, sums),
        _ => rows::<Wide>(costs, top, scratch, sums),
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
fn along_columns(costs: &Costs<'_>, left: usize, scratch: &mut [u8], strip: &mut [&mut [u8]]) {
    match costs.hypotheses().count {
        LANES => columns::<Narrow>(costs, left, scratch, strip),
        _ => columns::<Wide>(costs, left, scratch, strip),
    }
}

/// Advances paths along the rows from `top` on, both ways; their costs go to `scratch`.
#[inline(always)]
fn rows<P: Path>(costs: &Costs<'_>, top: usize, scratch: &mut [u8], sums: &mut [u8]) {
    let Hypotheses { width, count, ref first, .. } = *costs.hypotheses();
    let row = width * count;
    let mut paths: Vec<P> = (0..sums.len() / row).map(|_| P::new(count)).collect();
    let spans = &costs.spans()[top..top + paths.len()];
    scratch.chunks_exact_mut(row).enumerate().for_each(|(j, scratch)| costs.fill(scratch, top + j, 0..width));
    let span =
        spans.iter().filter(|span| !span.is_empty()).cloned().reduce(|p, q| p.start.min(q.start)..p.end.max(q.end));
    for x in there_and_back(span.unwrap_or_default()) {
        let Some(x) = x else {
            paths.iter_mut().for_each(|path| *path = P::new(count));
            continue;
        };
        for (j, path) in paths.iter_mut().enumerate() {
            let cell = j * row + x * count..j * row + (x + 1) * count;
            path.advance(first[(top + j) * width + x], &scratch[cell.clone()], &mut sums[cell]);
        }
    }
}

/// Advances paths along the columns of a strip from `left` on, both ways; their costs go to `scratch`.
#[inline(always)]
fn columns<P: Path>(costs: &Costs<'_>, left: usize, scratch: &mut [u8], strip: &mut [&mut [u8]]) {
    let Hypotheses { width, count, ref first, .. } = *costs.hypotheses();
    let columns = strip.first().map_or(0, |row| row.len() / count);
    let mut paths: Vec<P> = (0..columns).map(|_| P::new(count)).collect();
    let is_seen = |span: &Range<usize>| span.start < left + columns && span.end > left;
    let top = costs.spans().iter().position(is_seen).unwrap_or_default();
    let bottom = costs.spans().iter().rposition(is_seen).map_or(top, |last| last + 1);
    let row = columns * count;
    for y in top..bottom {
        costs.fill(&mut scratch[y * row..(y + 1) * row], y, left..left + columns);
    }
    for y in there_and_back(top..bottom) {
        let Some(y) = y else {
            paths.iter_mut().for_each(|path| *path = P::new(count));
            continue;
        };
        let first = &first[y * width + left..][..columns];
        let cells = scratch[y * row..].chunks_exact(count).zip(strip[y].chunks_exact_mut(count));
        for ((path, first), (costs, sums)) in paths.iter_mut().zip(first).zip(cells) {
            path.advance(*first, costs, sums);
        }
    }
}

/// Counts through `range` and, after `None`, back again.
fn there_and_back(range: Range<usize>) -> impl Iterator<Item = Option<usize>> {
    range.clone().map(Some).chain([None]).chain(range.rev().map(Some))
}

/// The costs at the last pixel of a path.
trait Path {
    /// A path before its first pixel, for `count` hypotheses.
    fn new(count: usize) -> Self;
    /// Advances the path to a pixel whose hypotheses begin with the disparity `first` and cost `costs`, and adds its costs there to `sums`.
    fn advance(&mut self, first: i32, costs: &[u8], sums: &mut [u8]);
}

/// Costs of as many hypotheses as a vector has, padded on both sides for those that were not tried.
struct Narrow {
    first: i32,
    /// Least cost at the last pixel, and that of a jump from it.
    bounds: [u8; 2],
    last: [u8; LANES + 2 * NARROW],
}

/// Padding of [`Narrow`].
const NARROW: usize = LANES + 2;

impl Path for Narrow {
    fn new(_: usize) -> Self {
        // At its first pixel a path has the costs alone.
        Self { first: 0, bounds: [0; 2], last: [UNTRIED; LANES + 2 * NARROW] }
    }

    #[inline(always)]
    fn advance(&mut self, first: i32, costs: &[u8], sums: &mut [u8]) {
        const MOST: i32 = NARROW as i32 - 1;
        let from = (MOST + (first - self.first).clamp(-MOST, MOST)) as usize;
        let (Some(costs), Some(sums)) = (costs.first_chunk::<LANES>(), sums.first_chunk_mut::<LANES>()) else { return };
        let mut next = [0; LANES];
        self.bounds = step(costs, &self.last[from..][..LANES + 2], self.bounds, &mut next, sums);
        self.last[NARROW..NARROW + LANES].copy_from_slice(&next);
        self.first = first;
    }
}

/// Costs of more hypotheses, padded in the same way.
struct Wide {
    first: i32,
    bounds: [u8; 2],
    last: Vec<u8>,
    next: Vec<u8>,
}

impl Path for Wide {
    fn new(count: usize) -> Self {
        let empty = vec![UNTRIED; 3 * count + 4];
        Self { first: 0, bounds: [0; 2], last: empty.clone(), next: empty }
    }

    #[inline(always)]
    fn advance(&mut self, first: i32, costs: &[u8], sums: &mut [u8]) {
        let (count, room) = (costs.len(), costs.len() + 2);
        let most = room as i32 - 1;
        let from = (most + (first - self.first).clamp(-most, most)) as usize;
        let before = &self.last[from..from + count + 2];
        self.bounds = step(costs, before, self.bounds, &mut self.next[room..room + count], sums);
        self.first = first;
        std::mem::swap(&mut self.last, &mut self.next);
    }
}

/// Writes the costs at the next pixel of a path to `next`, adds them to `sums`, and returns the least of them and that of a jump from there. `before` are those at the
/// last pixel, from the hypothesis before the first one on.
///
/// One plain loop: compilers turn it into the widest vector instructions that there are.
#[inline(always)]
fn step(costs: &[u8], before: &[u8], [least, jump]: [u8; 2], next: &mut [u8], sums: &mut [u8]) -> [u8; 2] {
    let count = costs.len();
    let (below, same, above) = (&before[..count], &before[1..count + 1], &before[2..count + 2]);
    let (next, sums) = (&mut next[..count], &mut sums[..count]);
    let mut lowest = u8::MAX;
    for i in 0..count {
        let near = below[i].min(above[i]).saturating_add(P1);
        let here = costs[i].wrapping_add(same[i].min(near).min(jump).wrapping_sub(least));
        next[i] = here;
        sums[i] = sums[i].saturating_add(here);
        lowest = lowest.min(here);
    }
    [lowest, lowest.wrapping_add(P2)]
}
