//! The sums of all path costs, some rows at a time: those of a whole view would be the largest part of the memory of the search.
//!
//! Paths along rows, and those down the columns, go on from block to block. Those that come up the columns have gone through all rows below before:
//! they are advanced twice, and kept where they enter each block in between.

use std::ops::Range;

use rayon::prelude::*;

use super::paths::{Paths, ROWS, along_columns, along_rows, upwards};
use super::volume::{Costs, Hypotheses};
use crate::pool::{give_back, memory};

/// Most sums of a block, in bytes; more rows than [`LEAST_ROWS`] have no more.
const MOST_SUMS: usize = 8 << 20;
/// Fewest rows of a block: of fewer, threads wait for each other.
const LEAST_ROWS: usize = 32;
/// Number of columns processed together: the costs of a strip of a block stay in the cache on the way there and back.
const STRIP: usize = 16;

/// Sums the path costs of every hypothesis, by rows, pixels and hypotheses, and lets `take` have those of each block, with the number of its first row.
///
/// Sums that would be larger are 255: where that is the least one, the views have nothing in common. Paths begin and end with the columns of each row that the left
/// camera sees: beyond them all hypotheses cost the same, so that a path brings nothing from there.
pub(super) fn summed(costs: &Costs<'_>, mut take: impl FnMut(usize, &[u8])) {
    let Hypotheses { width, height, count, .. } = *costs.hypotheses();
    let rows = (MOST_SUMS / (width * count).max(1)).max(LEAST_ROWS).next_multiple_of(ROWS);
    let blocks: Vec<Range<usize>> = (0..height).step_by(rows).map(|top| top..(top + rows).min(height)).collect();
    let mut strips: Vec<Strip> =
        (0..width).step_by(STRIP).map(|left| Strip::new(costs, left..(left + STRIP).min(width))).collect();
    strips.par_iter_mut().for_each(|strip| strip.rise(costs, &blocks));
    let mut sums = memory(rows.min(height) * width * count);
    for block in &blocks {
        let sums = &mut sums[..block.len() * width * count];
        sums.par_chunks_mut(ROWS * width * count).enumerate().for_each_init(Vec::new, |scratch, (group, sums)| {
            sums.fill(0);
            scratch.resize(sums.len(), 0);
            along_rows(costs, block.start + group * ROWS, scratch, sums);
        });
        let mut parts: Vec<Vec<&mut [u8]>> = strips.iter().map(|_| Vec::with_capacity(block.len())).collect();
        for row in sums.chunks_mut(width * count) {
            parts.iter_mut().zip(row.chunks_mut(STRIP * count)).for_each(|(part, row)| part.push(row));
        }
        let strips = strips.par_iter_mut().zip(&mut parts);
        strips.for_each_init(Vec::new, |scratch, (strip, part)| strip.add(costs, block, scratch, part));
        take(block.start, sums);
    }
    give_back(sums);
}

/// The paths along some columns.
struct Strip {
    columns: Range<usize>,
    /// From the first to the last row in which the left camera sees one of the columns.
    seen: Range<usize>,
    down: Paths,
    /// Where they enter each block that is not summed yet, that of the uppermost last.
    up: Vec<Paths>,
}

impl Strip {
    fn new(costs: &Costs<'_>, columns: Range<usize>) -> Self {
        let is_seen = |span: &Range<usize>| span.start < columns.end && span.end > columns.start;
        let top = costs.spans().iter().position(is_seen).unwrap_or_default();
        let bottom = costs.spans().iter().rposition(is_seen).map_or(top, |last| last + 1);
        let down = Paths::new(columns.len(), costs.hypotheses().count);
        Self { columns, seen: top..bottom, down, up: Vec::new() }
    }

    /// Advances the paths that come up as far as the first block.
    fn rise(&mut self, costs: &Costs<'_>, blocks: &[Range<usize>]) {
        // Before their first pixels they are as those that go down.
        let mut paths = self.down.clone();
        for block in blocks.iter().skip(1).rev() {
            self.up.push(paths.clone());
            upwards(costs, self.columns.start, self.seen_in(block), &mut paths);
        }
        self.up.push(paths);
    }

    /// Adds the costs of the paths through a block to `sums`, its part of each row.
    fn add(&mut self, costs: &Costs<'_>, block: &Range<usize>, scratch: &mut Vec<u8>, sums: &mut [&mut [u8]]) {
        let Some(mut up) = self.up.pop() else { return };
        let seen = self.seen_in(block);
        scratch.resize(seen.len() * self.columns.len() * costs.hypotheses().count, 0);
        let sums = &mut sums[seen.start - block.start..seen.end - block.start];
        along_columns(costs, self.columns.start, (seen, sums), scratch, [&mut self.down, &mut up]);
    }

    /// The rows of a block in which the left camera sees something.
    fn seen_in(&self, block: &Range<usize>) -> Range<usize> {
        let start = self.seen.start.clamp(block.start, block.end);
        start..self.seen.end.clamp(start, block.end)
    }
}
