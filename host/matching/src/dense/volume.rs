//! Costs: the dissimilarity of both views for every pixel and every hypothesis of its disparity. They are computed anew wherever they are
//! needed, which is faster than to read them from memory; only their sums make a volume.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::census::UNRELATED;
use crate::pool::{give_back, memory};

/// Number of hypotheses in a vector; volumes hold whole vectors.
pub(super) const LANES: usize = 16;

/// The disparities tried at each pixel of a left view: `first[pixel] + i` for i below `count`, in whole pixels.
#[derive(Clone, Debug)]
pub(super) struct Hypotheses {
    pub width: usize,
    pub height: usize,
    /// A multiple of [`LANES`].
    pub count: usize,
    pub first: Vec<i32>,
}

/// One view for the comparison: a census word for each pixel, and whether the camera sees its whole window.
pub(super) struct CensusView<'a> {
    pub words: Vec<u64>,
    pub seen: &'a [bool],
}

impl CensusView<'_> {
    /// From the first to the last pixel of each row that is seen.
    pub(super) fn spans(&self, width: usize) -> Vec<Range<usize>> {
        let span = |row: &[bool]| {
            let first = row.iter().position(|seen| *seen)?;
            Some(first..row.iter().rposition(|seen| *seen)? + 1)
        };
        self.seen.chunks_exact(width).map(|row| span(row).unwrap_or_default()).collect()
    }
}

/// Both views, ready for comparison.
pub(super) struct Costs<'a> {
    left: &'a CensusView<'a>,
    right: &'a Reversed,
    hypotheses: &'a Hypotheses,
    spans: &'a [Range<usize>],
}

impl<'a> Costs<'a> {
    pub(super) const fn new(
        left: &'a CensusView<'a>,
        right: &'a Reversed,
        hypotheses: &'a Hypotheses,
        spans: &'a [Range<usize>],
    ) -> Self {
        Self { left, right, hypotheses, spans }
    }

    /// The hypotheses that are compared.
    pub(super) const fn hypotheses(&self) -> &'a Hypotheses {
        self.hypotheses
    }

    /// The columns of each row that the left camera sees.
    pub(super) const fn spans(&self) -> &'a [Range<usize>] {
        self.spans
    }

    /// Computes the costs of some pixels of row `y`, by pixels and hypotheses. Beyond the columns that the left camera sees they are zero.
    pub(super) fn fill(&self, out: &mut [u8], y: usize, columns: Range<usize>) {
        let Hypotheses { width, count, ref first, .. } = *self.hypotheses;
        let row = y * width + columns.start..y * width + columns.end;
        let span = &self.spans[y];
        let within = |x: usize| x.clamp(columns.start, columns.end) - columns.start;
        let span = within(span.start)..within(span.end);
        out[..span.start * count].fill(0);
        out[span.end * count..].fill(0);
        let left = (&self.left.words[row.clone()], &self.left.seen[row.clone()]);
        differences((out, span), columns.start, left, &self.right.row(y), &first[row]);
    }
}

/// The right view with its rows in reverse order, so that the index grows with the disparity, padded on both sides.
pub(super) struct Reversed {
    words: Vec<u64>,
    /// All bits set where the pixel is seen, no bit elsewhere.
    known: Vec<u8>,
    width: usize,
    margin: usize,
}

impl Reversed {
    /// Rows of `width` pixels, for `count` hypotheses.
    pub(super) fn of(view: &CensusView<'_>, width: usize, count: usize) -> Self {
        let (margin, stride) = (count, width + 2 * count);
        let height = view.words.len() / width.max(1);
        let (mut words, mut known) = (memory(stride * height), memory(stride * height));
        let rows = words.par_chunks_mut(stride).zip(known.par_chunks_mut(stride));
        let views = view.words.par_chunks(width).zip(view.seen.par_chunks(width));
        rows.zip(views).for_each(|((words, known), (from, seen))| {
            for margin in [0..margin, margin + width..stride] {
                words[margin.clone()].fill(0);
                known[margin].fill(0);
            }
            words[margin..].iter_mut().zip(from.iter().rev()).for_each(|(word, from)| *word = *from);
            known[margin..].iter_mut().zip(seen.iter().rev()).for_each(|(known, seen)| {
                *known = if *seen { u8::MAX } else { 0 };
            });
        });
        Self { words, known, width, margin }
    }

    fn row(&self, y: usize) -> ReversedRow<'_> {
        let Self { width, margin, .. } = *self;
        let row = y * (width + 2 * margin)..(y + 1) * (width + 2 * margin);
        ReversedRow { words: &self.words[row.clone()], known: &self.known[row], width, margin }
    }

    /// Gives the memory back.
    pub(super) fn recycle(self) {
        give_back(self.words);
        give_back(self.known);
    }
}

/// A row of a [`Reversed`] view.
struct ReversedRow<'a> {
    words: &'a [u64],
    known: &'a [u8],
    width: usize,
    margin: usize,
}

impl ReversedRow<'_> {
    /// The words, and whether they are known, of the partners of the left pixel x from disparity `first` on.
    #[inline(always)]
    fn partners(&self, x: usize, first: i32, count: usize) -> (&[u64], &[u8]) {
        let at = (self.margin + self.width) as i64 - 1 - x as i64 + i64::from(first);
        let at = at.clamp(0, (self.width + self.margin) as i64) as usize;
        (&self.words[at..at + count], &self.known[at..at + count])
    }
}

/// Compares pixels from column `start` of a row on, those in `span` of them.
#[multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx512vpopcntdq+avx2+fma+popcnt",
    "x86_64+avx2+fma+popcnt",
    "x86_64+popcnt"
))]
fn differences(
    (costs, span): (&mut [u8], Range<usize>),
    start: usize,
    (words, seen): (&[u64], &[bool]),
    right: &ReversedRow<'_>,
    first: &[i32],
) {
    let count = costs.len() / words.len().max(1);
    for (x, cell) in span.clone().zip(costs[span.start * count..].chunks_exact_mut(count)) {
        if !seen[x] {
            cell.fill(UNRELATED);
            continue;
        }
        let (others, known) = right.partners(start + x, first[x], count);
        let (cell, _) = cell.as_chunks_mut::<LANES>();
        for (cell, (others, known)) in
            cell.iter_mut().zip(others.as_chunks::<LANES>().0.iter().zip(known.as_chunks::<LANES>().0))
        {
            let different: [u8; LANES] = std::array::from_fn(|k| (words[x] ^ others[k]).count_ones() as u8);
            *cell = std::array::from_fn(|k| if known[k] == 0 { UNRELATED } else { different[k] });
        }
    }
}
