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
        let (Some(costs), Some(sums)) = (costs.first_chunk(), sums.first_chunk_mut()) else { return };
        let here = step(costs, &self.last[from..][..LANES + 2], self.bounds, sums);
        self.last[NARROW..NARROW + LANES].copy_from_slice(&here);
        self.bounds = bounds(&here);
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
        let costs = costs.as_chunks::<LANES>().0;
        let (next, sums) = (self.next[room..room + count].as_chunks_mut().0, sums.as_chunks_mut().0);
        let mut least = [u8::MAX; LANES];
        for (block, ((costs, next), sums)) in costs.iter().zip(next).zip(sums).enumerate() {
            *next = step(costs, &before[block * LANES..][..LANES + 2], self.bounds, sums);
            least = std::array::from_fn(|i| least[i].min(next[i]));
        }
        self.bounds = bounds(&least);
        self.first = first;
        std::mem::swap(&mut self.last, &mut self.next);
    }
}

/// The least of some costs, and that of a jump from there.
#[inline(always)]
fn bounds(costs: &[u8; LANES]) -> [u8; 2] {
    let eight: [u8; 8] = std::array::from_fn(|i| costs[i].min(costs[i + 8]));
    let four: [u8; 4] = std::array::from_fn(|i| eight[i].min(eight[i + 4]));
    let least = four[0].min(four[2]).min(four[1].min(four[3]));
    [least, least.wrapping_add(P2)]
}

/// The costs of a block of hypotheses at the next pixel of a path, which are added to `sums`. `before` are those at the last pixel, from the hypothesis before
/// the first one on.
#[inline(always)]
fn step(costs: &[u8; LANES], before: &[u8], [least, jump]: [u8; 2], sums: &mut [u8; LANES]) -> [u8; LANES] {
    let of = |from: usize| -> [u8; LANES] { before[from..].first_chunk().copied().unwrap_or([UNTRIED; LANES]) };
    let (below, same, above) = (of(0), of(1), of(2));
    let here: [u8; LANES] = std::array::from_fn(|i| {
        let near = below[i].min(above[i]).saturating_add(P1);
        costs[i].wrapping_add(same[i].min(near).min(jump).wrapping_sub(least))
    });
    *sums = std::array::from_fn(|i| sums[i].saturating_add(here[i]));
    here
}
