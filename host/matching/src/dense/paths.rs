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

use super::volume::{Costs, Hypotheses, LANES};

/// Penalty of a step by one hypothesis, as on slanted surfaces.
const P1: u8 = 8;
/// Penalty of a larger step, as at edges of objects.
const P2: u8 = 60;
/// Number of rows whose paths are advanced together: each pixel of a path waits for the one before, those of other paths do not.
pub(super) const ROWS: usize = 4;
/// Cost of a hypothesis that the neighbour did not try, larger than any true cost: those are at most 62 + P2, and that of a jump 62 + 2 P2.
const UNTRIED: u8 = u8::MAX;

/// Paths side by side.
#[derive(Clone)]
pub(super) enum Paths {
    Narrow(Vec<Narrow>),
    Wide(Vec<Wide>),
}

impl Paths {
    /// So many paths before their first pixels, for `count` hypotheses.
    pub(super) fn new(paths: usize, count: usize) -> Self {
        match count {
            LANES => Self::Narrow((0..paths).map(|_| Narrow::new(count)).collect()),
            _ => Self::Wide((0..paths).map(|_| Wide::new(count)).collect()),
        }
    }
}

/// Advances paths along the rows from `top` on, both ways, and adds their costs to `sums`; the costs of the pixels go to `scratch`.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
pub(super) fn along_rows(costs: &Costs<'_>, top: usize, scratch: &mut [u8], sums: &mut [u8]) {
    match costs.hypotheses().count {
        LANES => rows::<Narrow>(costs, top, scratch, sums),
        _ => rows::<Wide>(costs, top, scratch, sums),
    }
}

/// Advances paths up the columns from `left` on, through some rows.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
pub(super) fn upwards(costs: &Costs<'_>, left: usize, rows: Range<usize>, paths: &mut Paths) {
    match paths {
        Paths::Narrow(paths) => through(costs, left, rows, paths),
        Paths::Wide(paths) => through(costs, left, rows, paths),
    }
}

/// Advances paths `down` and `up` the columns from `left` on, and adds their costs to the `sums` of some rows; the costs of the pixels go to `scratch`.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2+fma+popcnt", "x86_64+avx2+fma+popcnt"))]
pub(super) fn along_columns(
    costs: &Costs<'_>,
    left: usize,
    (rows, sums): (Range<usize>, &mut [&mut [u8]]),
    scratch: &mut [u8],
    paths: [&mut Paths; 2],
) {
    match paths {
        [Paths::Narrow(down), Paths::Narrow(up)] => columns(costs, left, (rows, sums), scratch, [down, up]),
        [Paths::Wide(down), Paths::Wide(up)] => columns(costs, left, (rows, sums), scratch, [down, up]),
        _ => {}
    }
}

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

#[inline(always)]
fn through<P: Path>(costs: &Costs<'_>, left: usize, rows: Range<usize>, paths: &mut [P]) {
    let Hypotheses { width, count, ref first, .. } = *costs.hypotheses();
    let mut row = vec![0; paths.len() * count];
    let mut unused = vec![0; count];
    for y in rows.rev() {
        costs.fill(&mut row, y, left..left + paths.len());
        for ((path, first), costs) in paths.iter_mut().zip(&first[y * width + left..]).zip(row.chunks_exact(count)) {
            path.advance(*first, costs, &mut unused);
        }
    }
}

#[inline(always)]
fn columns<P: Path>(
    costs: &Costs<'_>,
    left: usize,
    (rows, sums): (Range<usize>, &mut [&mut [u8]]),
    scratch: &mut [u8],
    [down, up]: [&mut [P]; 2],
) {
    let Hypotheses { width, count, ref first, .. } = *costs.hypotheses();
    let row = down.len() * count;
    for (scratch, y) in scratch.chunks_exact_mut(row).zip(rows.clone()) {
        costs.fill(scratch, y, left..left + down.len());
    }
    for (paths, y) in rows.clone().map(|y| (true, y)).chain(rows.clone().rev().map(|y| (false, y))) {
        let paths = if paths { &mut *down } else { &mut *up };
        let first = &first[y * width + left..][..paths.len()];
        let y = y - rows.start;
        let cells = scratch[y * row..].chunks_exact(count).zip(sums[y].chunks_exact_mut(count));
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
#[derive(Clone)]
pub(super) struct Narrow {
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
#[derive(Clone)]
pub(super) struct Wide {
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
