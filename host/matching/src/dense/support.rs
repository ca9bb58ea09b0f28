//! Support of disparities by their neighbours: which pixels are connected on one surface.
//!
//! Wrong disparities form small patches, because neighbours pull each other along the paths of the search. A patch that
//! is connected with no larger surface is removed (H. Hirschmüller, PAMI 30(2), 2008, section 2.5.1).

use std::ops::Range;

use rayon::prelude::*;

/// Largest difference in disparity, in pixels, of connected neighbours.
const CONNECTED: f32 = 1.0;

/// Whether each pixel belongs to a surface of fewer than `least` pixels, connected along rows and columns. Disparities
/// are NaN where there are none.
///
/// Rows are taken apart into runs of connected pixels, all at once; only their connections from row to row are joined one after the other.
pub(super) fn isolated(disparities: &[f32], width: usize, least: u32) -> Vec<bool> {
    let rows: Vec<Vec<Range<usize>>> = disparities.par_chunks(width).map(runs).collect();
    let firsts: Vec<usize> = rows
        .iter()
        .scan(0, |next, runs| {
            *next += runs.len();
            Some(*next - runs.len())
        })
        .collect();
    let links: Vec<Vec<[u32; 2]>> = (1..rows.len())
        .into_par_iter()
        .map(|y| {
            let row = |y: usize| (&rows[y][..], &disparities[y * width..][..width], firsts[y]);
            links(row(y - 1), row(y))
        })
        .collect();
    let count = rows.iter().map(Vec::len).sum();
    let mut sets = Sets((0..count as u32).collect());
    links.iter().flatten().for_each(|&[one, other]| sets.join(one, other));
    let mut sizes = vec![0_u32; count];
    for (run, index) in rows.iter().flatten().zip(0..) {
        sizes[sets.root(index) as usize] += run.len() as u32;
    }
    let roots: Vec<u32> = (0..count as u32).map(|index| sets.root(index)).collect();
    let mut isolated = vec![true; disparities.len()];
    isolated.par_chunks_mut(width.max(1)).zip(&rows).zip(&firsts).for_each(|((isolated, runs), first)| {
        for (run, root) in runs.iter().zip(&roots[*first..]) {
            isolated[run.clone()].fill(sizes[*root as usize] < least);
        }
    });
    isolated
}

fn connected(one: f32, other: f32) -> bool {
    (one - other).abs() <= CONNECTED
}

/// The runs of connected pixels of a row.
fn runs(row: &[f32]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut before = f32::NAN;
    for (x, &disparity) in row.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if connected(disparity, before) => run.end = x + 1,
            _ if disparity.is_nan() => {}
            _ => runs.push(x..x + 1),
        }
        before = disparity;
    }
    runs
}

/// Pairs of connected runs of two rows, one above the other: each row's runs, its disparities, and the number of its first run.
fn links(
    (above, disparities_above, first_above): (&[Range<usize>], &[f32], usize),
    (below, disparities_below, first_below): (&[Range<usize>], &[f32], usize),
) -> Vec<[u32; 2]> {
    let (mut links, mut one, mut other) = (Vec::new(), 0, 0);
    while let (Some(upper), Some(lower)) = (above.get(one), below.get(other)) {
        let mut shared = upper.start.max(lower.start)..upper.end.min(lower.end);
        if shared.any(|x| connected(disparities_above[x], disparities_below[x])) {
            links.push([(first_above + one) as u32, (first_below + other) as u32]);
        }
        if upper.end < lower.end { one += 1 } else { other += 1 }
    }
    links
}

/// Disjoint sets of runs, each by its parent; a root is its own parent.
struct Sets(Vec<u32>);

impl Sets {
    fn root(&mut self, mut index: u32) -> u32 {
        let parents = &mut self.0;
        while parents[index as usize] != index {
            let grandparent = parents[parents[index as usize] as usize];
            parents[index as usize] = grandparent;
            index = grandparent;
        }
        index
    }

    /// Makes the smaller root the common one.
    fn join(&mut self, one: u32, other: u32) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other) as usize] = one.min(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_counted_across_rows_and_not_across_steps() {
        const NONE: f32 = f32::NAN;
        // A ring of seven, a single pixel in it two pixels nearer, and a pair beyond a gap.
        let disparities = [
            5.0, 5.5, 6.0, NONE, 9.0, //
            5.0, 8.0, 6.5, NONE, 9.5, //
            5.2, 5.8, NONE, NONE, NONE,
        ];
        let found: Vec<u8> = isolated(&disparities, 5, 3).into_iter().map(u8::from).collect();
        assert_eq!(found, [0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 0, 0, 1, 1, 1]);
        assert!(isolated(&disparities, 5, 8).into_iter().all(|small| small));
    }
}
