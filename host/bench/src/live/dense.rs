//! Points and a range of every pixel, of pairs that follow one another.

use vergence_matching::{Matcher, TrackingMatcher};
use vergence_pipeline::{Method, PairCost, PointBudget, Search, dense_ranges};
use vergence_vision::median;

use super::paced::Paced;
use super::{LEAST_POINTS, LiveFrames, LivePair, Memory, points};
use crate::error::BenchError;
use crate::{Clock, timed};

/// The most pairs that come.
const MOST_PAIRS: usize = 25;
/// Pixels along a side up to which pairs come at the first of [`RATES`].
const SMALL: u32 = 640;
/// Pairs in a second, of small images and of larger ones.
const RATES: [f64; 2] = [5.0, 1.0];

/// What became of the pairs.
#[derive(Clone, Debug, Default)]
pub struct DenseFigures {
    /// Pairs that came in a second.
    pub rate: f64,
    /// Pairs that came.
    pub came: usize,
    /// Seconds from the exposure of each measured pair to its ranges.
    pub latency: Vec<f64>,
    /// Seconds that the ranges of each took.
    pub seconds: Vec<f64>,
    /// The part of its pixels that has a range.
    pub shares: Vec<f64>,
    /// Points of each that are right, and all.
    pub points: Vec<[usize; 2]>,
    /// Most mebibytes that the process had meanwhile.
    pub peak: u64,
}

impl DenseFigures {
    /// Measures up to `count` pairs of `frames` as `run --dense` does. `tracking` may have seen others before.
    ///
    /// # Errors
    /// Where a pair cannot be measured.
    pub(super) fn of(
        frames: &LiveFrames,
        tracking: &TrackingMatcher,
        count: usize,
        clock: Clock,
    ) -> Result<Self, BenchError> {
        let rate = RATES[usize::from(frames.rig.left_camera.size().width > SMALL)];
        let most = tracking.most_points().unwrap_or(usize::MAX);
        let mut budget = PointBudget::new(LEAST_POINTS, most, Some(rate.recip()));
        let mut figures = Self { rate, came: count.min(MOST_PAIRS), ..Self::default() };
        let mut paced = Paced::new(rate, figures.came);
        Memory::forget_peak();
        while let Some(number) = paced.next() {
            let pair = frames.at(number);
            let limit = budget.limit().map(|limit| limit.most);
            let method = Method { points: limit, ..Method::from(tracking as &dyn Matcher) };
            let (found, for_points) = timed(clock, || points(&frames.rig, &pair, method, &mut |_| ()));
            let (share, for_pixels) = timed(clock, || measured_share(frames, &pair));
            budget.came_after(rate.recip());
            budget.took(PairCost { points: for_points, others: for_pixels });
            figures.latency.push(paced.took(for_points + for_pixels));
            figures.seconds.push(for_pixels);
            figures.shares.push(share?);
            figures.points.push(frames.judge(pair.frame, &found?));
        }
        figures.peak = Memory::now().peak;
        Ok(figures)
    }

    /// Pairs that came while one was measured, and were not measured.
    #[must_use]
    pub fn skipped(&self) -> usize {
        self.came - self.latency.len()
    }

    /// The medians of the milliseconds that ranges took and of the part of the pixels that has one.
    pub(super) fn usual(&self) -> [f64; 2] {
        [&self.seconds, &self.shares].map(|values| median(values.clone()).unwrap_or_default())
    }
}

/// The part of the pixels of a pair that has a range.
fn measured_share(frames: &LiveFrames, pair: &LivePair<'_>) -> Result<f64, BenchError> {
    let ranges = dense_ranges(pair.images(), (&frames.rig, &Search::default()), &pair.pose, &mut |_| ());
    let depth = ranges.map_err(|error| BenchError::Work(error.to_string()))?.depth;
    Ok(depth.counts().measured as f64 / depth.samples().len().max(1) as f64)
}
