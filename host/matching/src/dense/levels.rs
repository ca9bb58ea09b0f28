//! The search for disparities from the coarsest level, where all are tried, to the finest, where only those near the
//! coarser result are.

use rayon::prelude::*;
use vergence_vision::Frame;

use super::census::{REACH, census};
use super::paths::gathered;
use super::volume::{CensusView, Hypotheses, LANES, costs};
use super::winner::winners;
use crate::View;
use crate::epipolar_band::EpipolarBand;
use crate::plane::{Plane, Pyramid};

/// Largest number of pixels of the coarsest level.
const COARSEST: usize = 400_000;
/// Number of negative disparities tried, in pixels of the coarsest level: they occur if the pose is slightly wrong.
const BEYOND_INFINITY: i32 = 3;
/// Number of hypotheses at the finer levels.
const REFINED: usize = LANES;

/// Finds disparities of the left view's pixels, up to those that `band` allows, in pixels; NaN where there is none.
pub(super) fn swept<L: Frame, R: Frame>(left: &View<L>, right: &View<R>, band: &EpipolarBand) -> Vec<f32> {
    let pixels = left.plane().values().len();
    let count = (0..).find(|level| pixels >> (2 * level) <= COARSEST).unwrap_or(0) + 1;
    let [left_levels, right_levels] = [left.plane(), right.plane()].map(|plane| Pyramid::new(plane, count));
    let [left_seen, right_seen] = [left.seen(), right.seen()].map(|seen| SeenTable::new(seen, left.grid().size().0));
    let largest = (0..left.grid().size().0).map(|x| band.largest_disparity(x as f64)).fold(0.0, f64::max);
    let mut coarser: Option<Vec<f32>> = None;
    for (level, (plane, right_plane)) in left_levels.levels().iter().zip(right_levels.levels()).enumerate().rev() {
        let scale = 1 << level;
        let hypotheses = match &coarser {
            None => all(plane, (largest / scale as f64).ceil() as usize),
            Some(disparities) => near(plane, disparities),
        };
        let left_view = CensusView { words: census(plane), seen: left_seen.level(plane, scale) };
        let right_view = CensusView { words: census(right_plane), seen: right_seen.level(right_plane, scale) };
        let sums = gathered(&costs([&left_view, &right_view], &hypotheses), &hypotheses);
        coarser = Some(winners(&sums, [&left_view.seen, &right_view.seen], &hypotheses));
    }
    coarser.unwrap_or_default()
}

/// The hypotheses of the coarsest level: every disparity up to `largest` at every pixel.
fn all(plane: &Plane, largest: usize) -> Hypotheses {
    let count = (largest + 2 * BEYOND_INFINITY as usize + 1).next_multiple_of(LANES);
    let first = vec![-BEYOND_INFINITY; plane.values().len()];
    Hypotheses { width: plane.width(), height: plane.height(), count, first }
}

/// The hypotheses of a finer level: those around twice the disparities of the next coarser one.
fn near(plane: &Plane, coarser: &[f32]) -> Hypotheses {
    let (width, height) = (plane.width(), plane.height());
    let coarser_width = width.div_ceil(2);
    let mut first = vec![0; width * height];
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
fn filled(row: &[f32]) -> Vec<f32> {
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
