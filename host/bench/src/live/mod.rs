//! The live matcher on rendered pairs that follow one another: its rate, its delay, and how many of its points are right.
//!
//! Pairs come as often as cameras deliver them; while one is measured, those that come are skipped but for the newest, as in the live loop. When they
//! come is reckoned, and what measuring takes is measured, so that nobody waits. Encoders of stages that stand read a count beside the true one now
//! and then. Afterwards pairs come at which every pixel is measured too, the single-pair matcher measures some of the same pairs, and
//! OpenCV matches them by ORB and by pyramidal Lucas-Kanade, without any knowledge of the pose.

mod dense;
mod memory;
mod paced;
mod peer;
mod rendered;
mod report;

use std::time::Duration;

use vergence_matching::{GuidedMatcher, Matcher, TrackingMatcher};
use vergence_pipeline::{Method, PairCost, PairPose, PointBudget, Stage, StageTimes, StandingPose, refined_cloud};
use vergence_rig::Rig;
use vergence_vision::median;

pub use self::dense::DenseFigures;
pub use self::memory::Memory;
use self::memory::computed_seconds;
use self::paced::Paced;
pub use self::peer::{PeerMatches, PeerMatching};
pub use self::rendered::{LiveFrame, LiveFrames, LivePair, Way};
use crate::error::BenchError;
use crate::{Clock, timed};

/// What the live matcher made of the pairs of one way.
#[derive(Clone, Debug, Default)]
pub struct LiveFigures {
    /// Pairs that came.
    pub came: usize,
    /// Pairs that were measured.
    pub measured: usize,
    /// Seconds from the first pair to the last result.
    pub seconds: f64,
    /// Seconds from the exposure of each measured pair to its points.
    pub latency: Vec<f64>,
    /// Seconds that each of [`STAGES`] took, over all pairs.
    pub stages: [f64; 2],
    /// Seconds that all threads together computed for the measured pairs.
    pub computed: f64,
    /// Points of each pair that are right, and all.
    pub points: Vec<[usize; 2]>,
    /// Most points that there was time for, of each measured pair.
    pub limits: Vec<usize>,
    /// Measured pairs whose views lay in the images as those of the pair before.
    pub kept_views: u64,
    /// Right points and all of the single-pair matcher on some of the pairs.
    pub single: Vec<[usize; 2]>,
    /// Seconds that the single-pair matcher took for each.
    pub single_seconds: Vec<f64>,
    /// Pairs of which every pixel was measured too.
    pub dense: DenseFigures,
    /// Memory after a quarter of the live pairs and at their end, with the images of all pairs.
    pub memory: [Memory; 2],
}

/// The stages of a pair.
pub const STAGES: [Stage; 2] = [Stage::Match, Stage::Triangulate];
/// How often the single-pair matcher measures: every so many pairs.
const SINGLE_EVERY: usize = 10;
/// Fewest points to which time limits a pair, as `run` has it without an option.
const LEAST_POINTS: usize = 150;

impl LiveFigures {
    /// Measures `count` pairs of `frames`, of which `rate` come in a second.
    ///
    /// # Errors
    /// Where a pair cannot be measured.
    pub fn of(frames: &LiveFrames, rate: f64, count: usize, clock: Clock) -> Result<Self, BenchError> {
        let tracking = TrackingMatcher::default();
        let mut figures = Self::live(frames, &tracking, (rate, count), clock)?;
        // Afterwards: it needs memory and caches that a live matcher has to itself.
        figures.dense = DenseFigures::of(frames, &tracking, count, clock)?;
        drop(tracking);
        let single = GuidedMatcher::default();
        for number in (0..count).step_by(SINGLE_EVERY) {
            let (pair, method) = (frames.at(number), Method::from(&single as &dyn Matcher));
            let (alone, seconds) = timed(clock, || points(&frames.rig, &pair, method, &mut |_| ()));
            figures.single.push(frames.judge(pair.frame, &alone?));
            figures.single_seconds.push(seconds);
        }
        Ok(figures)
    }

    /// The pairs that come live.
    fn live(
        frames: &LiveFrames,
        tracking: &TrackingMatcher,
        (rate, count): (f64, usize),
        clock: Clock,
    ) -> Result<Self, BenchError> {
        let most = tracking.most_points().unwrap_or(usize::MAX);
        let mut budget = PointBudget::new(LEAST_POINTS, most, Some(rate.recip()));
        let (mut figures, mut paced) = (Self { came: count, ..Self::default() }, Paced::new(rate, count));
        Memory::forget_peak();
        while let Some(number) = paced.next() {
            let pair = frames.at(number);
            let (before, mut times) = (computed_seconds(), StageTimes::start(clock));
            let limit = budget.limit().map(|limit| limit.most);
            let method = Method { points: limit, ..Method::from(tracking as &dyn Matcher) };
            let (found, seconds) = timed(clock, || points(&frames.rig, &pair, method, &mut |stage| times.ended(stage)));
            budget.came_after(rate.recip());
            budget.took(PairCost { points: seconds, others: 0.0 });
            figures.limits.push(limit.unwrap_or(most));
            figures.computed += computed_seconds() - before;
            figures.latency.push(paced.took(seconds));
            figures.stages.iter_mut().zip(STAGES).for_each(|(sum, stage)| *sum += times.of(stage));
            figures.points.push(frames.judge(pair.frame, &found?));
            if number <= count / 4 {
                figures.memory = [Memory::now(); 2];
            }
            figures.measured += 1;
        }
        (figures.seconds, figures.memory[1]) = (paced.seconds(), Memory::now());
        figures.kept_views = tracking.kept_views();
        Ok(figures)
    }

    /// The median of the points that there was time for.
    #[must_use]
    pub fn limit(&self) -> usize {
        median(self.limits.iter().map(|most| *most as f64).collect()).unwrap_or_default() as usize
    }

    /// Median and 99th percentile of the delay.
    #[must_use]
    pub fn delay(&self) -> [Duration; 2] {
        let mut sorted = self.latency.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.get((sorted.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or_default();
        [median(sorted).unwrap_or_default(), last]
            .map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or_default())
    }
}

fn points(
    rig: &Rig,
    pair: &LivePair<'_>,
    method: Method<'_>,
    ended: &mut dyn FnMut(Stage),
) -> Result<Vec<vergence_vision::CloudPoint>, BenchError> {
    let (pose, mut standing) = (PairPose::standing(pair.pose.clone()), StandingPose::default());
    let cloud = refined_cloud(pair.images(), rig, &pose, method, &mut standing, ended);
    let cloud = cloud.map_err(|error| BenchError::Work(error.to_string()))?;
    Ok(cloud.points.into_iter().map(|point| point.point).collect())
}
