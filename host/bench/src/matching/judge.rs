//! Comparison of matches with the truth.

use nalgebra::Vector3;
use vergence_matching::Match;
use vergence_vision::median;
use vergence_vision::{Angle, CloudPoint, Pixel, Right, UnitRay};

use crate::matching::reliability::Reliability;
use crate::matching::simulated_pair::SimulatedPair;

/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object a keypoint belongs to the object or to its background: the truth is the nearest surface at this
/// distance around the keypoint, in pixels.
const AROUND_PX: f64 = 0.8;

/// A point whose range is off by more than this many standard deviations is an outlier: its score is the probability that it is none.
const OUTLIER_SIGMAS: f64 = 3.0;

/// Matches of a pair, and how many are right.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Matches.
    pub count: usize,
    /// Right matches.
    pub correct: usize,
    /// Median error of the right bearing, over the right matches.
    pub median_bearing_error: Angle,
    /// Points of registered matches.
    pub registered: Class,
    /// Points of the other matches.
    pub unregistered: Class,
    /// Scores of the points, and how many of them hold.
    pub reliability: Reliability,
}

/// Stated and real uncertainty of some points.
#[derive(Clone, Debug, Default)]
pub struct Class {
    /// Stated standard deviation of each point's match, in pixels.
    sigmas_px: Vec<f64>,
    /// Errors of the right matches in each direction, in pixels.
    errors_px: Vec<f64>,
    /// Absolute errors of the ranges in stated standard deviations.
    off_sigmas: Vec<f64>,
}

impl Tally {
    /// Tallies matches.
    #[must_use]
    pub fn of(matches: &[Match], pair: &SimulatedPair) -> Self {
        let verdicts: Vec<Verdict> = matches.iter().map(|found| Verdict::of(found.left, found.right, pair)).collect();
        Self::of_verdicts(&verdicts)
    }

    fn of_verdicts(verdicts: &[Verdict]) -> Self {
        let correct: Vec<&Verdict> = verdicts.iter().filter(|verdict| verdict.is_right()).collect();
        let bearing = median(correct.iter().map(|verdict| verdict.bearing_rad).collect()).unwrap_or_default();
        Self {
            count: verdicts.len(),
            correct: correct.len(),
            median_bearing_error: Angle::from_rad(bearing),
            ..Self::default()
        }
    }

    /// Tallies the points that `matches` made.
    #[must_use]
    pub fn of_points(points: &[CloudPoint], matches: &[Match], pair: &SimulatedPair) -> Self {
        let judged = points.iter().filter_map(|point| Some((point, matches.get(point.pair_index)?)));
        let judged: Vec<Judged<'_>> = judged
            .map(|(point, found)| Judged { point, found, verdict: Verdict::of(found.left, found.right, pair) })
            .collect();
        let class = |registered: bool| Class::of(judged.iter().filter(|of| of.found.registered == registered));
        let mut reliability = Reliability::default();
        for of in &judged {
            let off = of.verdict.off_sigmas(of.point);
            off.into_iter().for_each(|off| reliability.add(of.found.score, off.abs() <= OUTLIER_SIGMAS));
        }
        let verdicts: Vec<Verdict> = judged.iter().map(|of| of.verdict).collect();
        Self { registered: class(true), unregistered: class(false), reliability, ..Self::of_verdicts(&verdicts) }
    }

    /// Part of the matches that is right.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.correct as f64 / self.count.max(1) as f64
    }
}

impl Class {
    fn of<'a>(points: impl Iterator<Item = &'a Judged<'a>>) -> Self {
        let mut class = Self::default();
        for Judged { point, found, verdict } in points {
            class.sigmas_px.push(found.sigma.mean());
            if verdict.is_right() {
                class.errors_px.extend(verdict.offset_px.map(f64::abs));
            }
            class.off_sigmas.extend(verdict.off_sigmas(point).map(f64::abs));
        }
        class
    }

    /// Adds the points of another pair.
    pub fn merge(&mut self, other: &Self) {
        self.sigmas_px.extend(&other.sigmas_px);
        self.errors_px.extend(&other.errors_px);
        self.off_sigmas.extend(&other.off_sigmas);
    }

    /// Number of points.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.sigmas_px.len()
    }

    /// Median of the stated standard deviations, in pixels.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        median(self.sigmas_px.clone()).unwrap_or_default()
    }

    /// Real standard deviation in pixels: 1.48 times the median error in each direction, shared by both images.
    #[must_use]
    pub fn spread_px(&self) -> f64 {
        1.483 * std::f64::consts::FRAC_1_SQRT_2 * median(self.errors_px.clone()).unwrap_or_default()
    }

    /// Part of all points whose range is off by at most so many standard deviations.
    #[must_use]
    pub fn within(&self, sigmas: f64) -> f64 {
        let within = self.off_sigmas.iter().filter(|off| **off <= sigmas).count();
        within as f64 / self.off_sigmas.len().max(1) as f64
    }

    /// Mean squared error of the range in stated standard deviations, over the points whose range is off by at most three: 0.97
    /// where the statement is right.
    #[must_use]
    pub fn nees(&self) -> f64 {
        let kept = || self.off_sigmas.iter().filter(|off| **off <= OUTLIER_SIGMAS);
        kept().map(|off| off * off).sum::<f64>() / kept().count().max(1) as f64
    }
}

/// A point, the match that made it, and the error of that match.
struct Judged<'a> {
    point: &'a CloudPoint,
    found: &'a Match,
    verdict: Verdict,
}

/// Error of a match.
#[derive(Clone, Copy)]
struct Verdict {
    offset_px: [f64; 2],
    bearing_rad: f64,
    /// Range of what the left pixel itself shows, from the left camera.
    range_mm: f64,
}

impl Verdict {
    fn of(left: Pixel, right: Pixel, pair: &SimulatedPair) -> Self {
        let places = [(0.0, 0.0), (AROUND_PX, 0.0), (-AROUND_PX, 0.0), (0.0, AROUND_PX), (0.0, -AROUND_PX)];
        // The direction is that of the keypoint itself; only the range is taken beside it.
        let truth = |(du, dv): (f64, f64)| -> Option<Self> {
            let beside = pair.range(Pixel { u: left.u + du, v: left.v + dv })?;
            let ray = pair.lens.unproject::<vergence_vision::Left>(left).ok()?;
            let there = (pair.left_from_right.inverse() * ray.at(beside.mm())).direction()?;
            let shown = pair.lens.project(&there).ok()?;
            let found: UnitRay<Right> = pair.lens.unproject(right).ok()?;
            let bearing_rad = angle(&found.vector(), &there.vector());
            Some(Self { offset_px: [right.u - shown.u, right.v - shown.v], bearing_rad, range_mm: beside.mm() })
        };
        let range_mm = pair.range(left).map_or(f64::NAN, |range| range.mm());
        let verdicts = places.into_iter().filter_map(truth).map(|verdict| Self { range_mm, ..verdict });
        verdicts.min_by(|a, b| a.error_px().total_cmp(&b.error_px())).unwrap_or(Self {
            offset_px: [f64::INFINITY; 2],
            bearing_rad: f64::INFINITY,
            range_mm: f64::NAN,
        })
    }

    fn error_px(&self) -> f64 {
        self.offset_px[0].hypot(self.offset_px[1])
    }

    fn is_right(&self) -> bool {
        self.error_px() <= RIGHT_PX
    }

    /// Error of the range of `point` in its standard deviations; `None` where the range is too uncertain for a linear statement.
    fn off_sigmas(&self, point: &CloudPoint) -> Option<f64> {
        /// Largest relative standard deviation of a range that takes part in the statistics.
        const USEFUL: f64 = 0.05;
        let (range, sigma) = (point.point.mm().norm(), point.sigma_range.mm());
        (sigma <= USEFUL * range && self.range_mm.is_finite()).then(|| (range - self.range_mm) / sigma)
    }
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
