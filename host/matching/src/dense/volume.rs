//! The cost volume: the dissimilarity of both views for every pixel and every hypothesis of its disparity.

use multiversion::multiversion;
use rayon::prelude::*;

use super::census::UNRELATED;

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
#[derive(Clone, Debug)]
pub(super) struct CensusView {
    pub words: Vec<u64>,
    pub seen: Vec<bool>,
}

/// Computes the costs, by rows, pixels and hypotheses.
pub(super) fn costs([left, right]: [&CensusView; 2], hypotheses: &Hypotheses) -> Vec<u8> {
    let Hypotheses { width, height, count, ref first } = *hypotheses;
    let mut costs = vec![UNRELATED; width * height * count];
    costs.par_chunks_mut(width * count).enumerate().for_each(|(y, out)| {
        let row = y * width..(y + 1) * width;
        let reversed = Reversed::of(&right.words[row.clone()], &right.seen[row.clone()], count);
        let seen = left.seen[row.clone()].iter().enumerate().filter(|(_, seen)| **seen);
        for (x, _) in seen {
            let partners = reversed.partners(x, first[row.start + x], count);
            differences(&mut out[x * count..(x + 1) * count], left.words[row.start + x], partners);
        }
    });
    costs
}

/// A right row in reverse order, so that the index grows with the disparity, padded on both sides.
struct Reversed {
    words: Vec<u64>,
    /// All bits set where the pixel is seen, no bit elsewhere.
    known: Vec<u64>,
    width: usize,
    margin: usize,
}

impl Reversed {
    fn of(words: &[u64], seen: &[bool], count: usize) -> Self {
        let (width, margin) = (words.len(), count);
        let mut reversed =
            Self { words: vec![0; width + 2 * margin], known: vec![0; width + 2 * margin], width, margin };
        for (x, (&word, &seen)) in words.iter().zip(seen).enumerate() {
            let at = margin + width - 1 - x;
            reversed.words[at] = word;
            reversed.known[at] = if seen { u64::MAX } else { 0 };
        }
        reversed
    }

    /// The words, and whether they are known, of the partners of the left pixel x from disparity `first` on.
    fn partners(&self, x: usize, first: i32, count: usize) -> [&[u64]; 2] {
        let at = (self.margin + self.width) as i64 - 1 - x as i64 + i64::from(first);
        let at = at.clamp(0, (self.width + self.margin) as i64) as usize;
        [&self.words[at..at + count], &self.known[at..at + count]]
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx512vpopcntdq+avx2+fma+popcnt",
    "x86_64+avx2+fma+popcnt",
    "x86_64+popcnt"
))]
fn differences(cell: &mut [u8], word: u64, [others, known]: [&[u64]; 2]) {
    for ((cost, other), known) in cell.iter_mut().zip(others).zip(known) {
        let different = (word ^ other).count_ones() as u8;
        *cost = if *known == 0 { UNRELATED } else { different };
    }
}
