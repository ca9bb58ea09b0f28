//! The search for disparities from the coarsest level, where all are tried, to the finest, where only those near the
//! coarser result are.

use rayon::prelude::*;
use vergence_vision::Frame;

use super::blocks::summed;
use super::census::{REACH, census};
use super::volume::{CensusView, Costs, Hypotheses, LANES, Reversed};
use super::winner::winners;
use crate::View;
use crate::epipolar_band::EpipolarBand;
use crate::plane::{Plane, Pyramid};
use crate::pool::{give_back, memory};

/// Largest number of pixels of the coarsest level.
const COARSEST: usize = 400_000;
/// Number of negative disparities tried, in pixels of the coarsest level: they occur if the pose is slightly wrong.
const BEYOND_INFINITY: i32 = 3;
/// Number of hypotheses at the finer levels.
const REFINED: usize = LANES;

/// Both views at several resolutions, finest first, with the pixels that each camera sees.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    planes: [Pyramid; 2],
    /// Whether the camera sees the whole census window of each pixel.
    seen: [Vec<Vec<bool>>; 2],
    /// Largest disparity that is sought, in pixels of the finest level.
    largest: f64,
}

impl Levels {
    /// Makes the levels of both views, with disparities up to those that `band` allows.
    pub(super) fn new<L: Frame, R: Frame>(left: &View<L>, right: &View<R>, band: &EpipolarBand) -> Self {
        let width = left.grid().size().0;
        let count = searched(left.plane()) + 1;
        let planes = [left.plane(), right.plane()].map(|plane| in_memory(plane, count));
        let seen = |seen: &[bool], planes: &Pyramid| -> Vec<Vec<bool>> {
            let table = SeenTable::new(seen, width);
            planes.levels().iter().enumerate().map(|(level, plane)| table.level(plane, 1 << level)).collect()
        };
        let (left_seen, right_seen) = rayon::join(|| seen(left.seen(), &planes[0]), || seen(right.seen(), &planes[1]));
        Self {
            planes,
            seen: [left_seen, right_seen],
            largest: (0..width).map(|x| band.largest_disparity(x as f64)).fold(0.0, f64::max),
        }
    }

    /// Both views at all levels.
    pub(super) fn planes(&self) -> [&Pyramid; 2] {
        self.planes.each_ref()
    }

    /// Finds disparities of the left view's pixels, in pixels; NaN where there is none.
    pub(super) fn swept(&self) -> Vec<f32> {
        let levels = self.count().min(self.planes[0].levels().first().map_or(0, searched));
        let mut coarser: Option<Vec<f32>> = None;
        for level in (0..levels).rev() {
            let plane = &self.planes[0].levels()[level];
            let hypotheses = match &coarser {
                None => self.all(level),
                Some(disparities) => near(plane, disparities),
            };
            let found = self.winners(level, hypotheses);
            if let Some(coarser) = coarser.replace(found) {
                give_back(coarser);
            }
        }
        coarser.unwrap_or_default()
    }

    /// Finds disparities at the coarsest level, one coarser than the search begins with, in its pixels. The number of
    /// the level comes first.
    pub(super) fn swept_coarsely(&self) -> (usize, Vec<f32>) {
        match self.count().checked_sub(1) {
            Some(level) => (level, self.winners(level, self.all(level))),
            None => (0, Vec::new()),
        }
    }

    /// The number of pixels of the finest level in one of the coarsest level that is searched.
    pub(super) fn coarsest_area(&self) -> usize {
        let searched = self.planes[0].levels().first().map_or(1, searched);
        1 << (2 * (self.count().clamp(1, searched) - 1))
    }

    fn count(&self) -> usize {
        self.planes[0].levels().len()
    }

    /// Every disparity at every pixel of a level.
    fn all(&self, level: usize) -> Hypotheses {
        all(&self.planes[0].levels()[level], (self.largest / (1_usize << level) as f64).ceil() as usize)
    }

    /// The disparities among `hypotheses` on which both views agree.
    fn winners(&self, level: usize, hypotheses: Hypotheses) -> Vec<f32> {
        let Hypotheses { width, count, .. } = hypotheses;
        let seen = self.seen.each_ref().map(|seen| &seen[level][..]);
        let view = |side: usize| {
            let plane: &Plane = &self.planes[side].levels()[level];
            CensusView { words: census(plane), seen: seen[side] }
        };
        let right = view(1);
        let reversed = Reversed::of(&right, width, count);
        give_back(right.words);
        let left = view(0);
        let spans = left.spans(width);
        let mut disparities = memory(hypotheses.first.len());
        summed(&Costs::new(&left, &reversed, &hypotheses, &spans), |top, sums| {
            winners(&mut disparities, (top, sums), seen, &hypotheses);
        });
        reversed.recycle();
        give_back(left.words);
        give_back(hypotheses.first);
        disparities
    }
}

impl Drop for Levels {
    fn drop(&mut self) {
        let mut buffers = Vec::new();
        std::mem::take(&mut self.planes).into_iter().for_each(|planes| planes.recycle(&mut buffers));
        buffers.into_iter().for_each(give_back);
    }
}

/// A pyramid of `plane` in memory that was used before.
fn in_memory(plane: &Plane, levels: usize) -> Pyramid {
    let area = |level: usize| plane.width().div_ceil(1 << level) * plane.height().div_ceil(1 << level);
    // The last is taken first.
    let mut buffers = (0..levels).rev().map(|level| memory(area(level))).collect();
    let pyramid = Pyramid::in_buffers(plane, levels, &mut buffers);
    buffers.into_iter().for_each(give_back);
    pyramid
}

/// The number of levels that are searched for the disparities of a plane.
fn searched(plane: &Plane) -> usize {
    (0..).find(|level| plane.values().len() >> (2 * level) <= COARSEST).unwrap_or(0) + 1
}

/// The hypotheses of the coarsest level: every disparity up to `largest` at every pixel.
fn all(plane: &Plane, largest: usize) -> Hypotheses {
    let count = (largest + 2 * BEYOND_INFINITY as usize + 1).next_multiple_of(LANES);
    let mut first = memory(plane.values().len());
    first.fill(-BEYOND_INFINITY);
    Hypotheses { width: plane.width(), height: plane.height(), count, first }
}

/// The hypotheses of a finer level: those around twice the disparities of the next coarser one.
fn near(plane: &Plane, coarser: &[f32]) -> Hypotheses {
    let (width, height) = (plane.width(), plane.height());
    let coarser_width = width.div_ceil(2);
    let mut first = memory(width * height);
    first.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let filled = filled(&coarser[(y / 2) * coarser_width..][..coarser_width]);
        for (x, first) in row.iter_mut().enumerate() {
            *first = (2.0 * filled[x / 2]).round() as i32 - REFINED as i32 / 2;
        }
    });
    Hypotheses { width, height, count: REFINED, first }
}

/// Fills the gaps of a row with the smaller of the disparities beside them, because surfaces that only one camera sees
/// are behind.
pub(super) fn filled(row: &[f32]) -> Vec<f32> {
    let mut filled = row.to_vec();
    let mut last = f32::INFINITY;
    for value in filled.iter_mut() {
        last = if value.is_nan() { last } else { *value };
        *value = last;
    }
    let mut last = f32::INFINITY;
    for (value, &own) in filled.iter_mut().zip(row).rev() {
        last = if own.is_nan() { last } else { own };
        *value = if own.is_nan() { value.min(last) } else { own };
        // A row without any disparity takes zero, that of infinity.
        *value = if value.is_finite() { *value } else { 0.0 };
    }
    filled
}

/// A summed-area table of the pixels that a camera sees.
#[derive(Clone, Debug)]
struct SeenTable {
    counts: Vec<u32>,
    stride: usize,
}

impl SeenTable {
    fn new(seen: &[bool], width: usize) -> Self {
        let stride = width + 1;
        let mut counts = vec![0; stride * (seen.len() / width + 1)];
        for (y, row) in seen.chunks_exact(width).enumerate() {
            let mut along = 0;
            for (x, &seen) in row.iter().enumerate() {
                along += u32::from(seen);
                counts[(y + 1) * stride + x + 1] = counts[y * stride + x + 1] + along;
            }
        }
        Self { counts, stride }
    }

    /// Whether the camera sees the whole census window of each pixel of a level, whose pixels are `scale` apart.
    fn level(&self, plane: &Plane, scale: usize) -> Vec<bool> {
        let (width, height) = (self.stride - 1, self.counts.len() / self.stride - 1);
        let reach = REACH.map(|reach| (reach + 1) * scale);
        let mut whole = vec![false; plane.values().len()];
        whole.par_chunks_mut(plane.width()).enumerate().for_each(|(y, row)| {
            let (y, count) = (y * scale, (2 * reach[0] + 1) * (2 * reach[1] + 1));
            if y < reach[1] || y + reach[1] >= height {
                return;
            }
            let [above, below] =
                [y - reach[1], y + reach[1] + 1].map(|y| &self.counts[y * self.stride..][..self.stride]);
            for (x, whole) in row.iter_mut().enumerate().map(|(x, whole)| (x * scale, whole)) {
                if x >= reach[0] && x + reach[0] < width {
                    let (left, right) = (x - reach[0], x + reach[0] + 1);
                    *whole = below[right] + above[left] - below[left] - above[right] == count as u32;
                }
            }
        });
        whole
    }
}
