//! Comparison of matches with the truth.

use nalgebra::Vector3;
use vergence_matching::Match;
use vergence_vision::median;
use vergence_vision::{Angle, CloudPoint, Pixel, Right, UnitRay};

use crate::matching::simulated_pair::SimulatedPair;

/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object a keypoint belongs to the object or to its background: the truth is the nearest surface at this
/// distance around the keypoint, in pixels.
const AROUND_PX: f64 = 0.8;

/// Matches of a pair, and how many are right.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Matches.
    pub count: usize,
    /// Right matches.
    pub correct: usize,
    /// Median error of the right bearing, over the right matches.
    pub median_bearing_error: Angle,
    /// Points with the smaller half of the stated position errors.
    pub sharp: Class,
    /// The other points.
    pub coarse: Class,
}

/// Stated and real uncertainty of some points.
#[derive(Clone, Debug, Default)]
pub struct Class {
    /// Points.
    pub count: usize,
    /// Median of the stated standard deviations, in pixels.
    pub sigma_px: f64,
    /// Real standard deviation in pixels: 1.48 times the median error in each direction, shared by both images.
    pub spread_px: f64,
    /// Mean squared error of the range in stated standard deviations, over the right points: 1 where the statement is right.
    pub nees: f64,
    /// Part of all points whose range is off by at most two standard deviations: 0.95 where the statement is right.
    pub within_two_sigma: f64,
}

impl Tally {
    /// Tallies matches.
    #[must_use]
    pub fn of(matches: &[Match], pair: &SimulatedPair) -> Self {
        let verdicts: Vec<Verdict> = matches.iter().map(|found| Verdict::of(found.left, found.right, pair)).collect();
        let correct: Vec<&Verdict> = verdicts.iter().filter(|verdict| verdict.is_right()).collect();
        let bearing = median(correct.iter().map(|verdict| verdict.bearing_rad).collect()).unwrap_or_default();
        Self {
            count: matches.len(),
            correct: correct.len(),
            median_bearing_error: Angle::from_rad(bearing),
            ..Self::default()
        }
    }

    /// Tallies the points that `matches` made.
    #[must_use]
    pub fn of_points(points: &[CloudPoint], matches: &[Match], pair: &SimulatedPair) -> Self {
        let kept: Vec<Match> = points.iter().filter_map(|point| matches.get(point.pair_index).copied()).collect();
        let sigmas = || kept.iter().map(|found| found.sigma);
        let middle = (sigmas().fold(f64::INFINITY, f64::min) + sigmas().fold(0.0, f64::max)) / 2.0;
        let both: Vec<(&CloudPoint, &Match)> = points.iter().zip(&kept).collect();
        let class = |sharp: bool| {
            Class::of(
                &both.iter().filter(|(_, found)| (found.sigma <= middle) == sharp).copied().collect::<Vec<_>>(),
                pair,
            )
        };
        Self { sharp: class(true), coarse: class(false), ..Self::of(&kept, pair) }
    }

    /// Part of the matches that is right.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.correct as f64 / self.count.max(1) as f64
    }
}

impl Class {
    /// Largest relative standard deviation of a range that takes part in the statistics.
    const USEFUL: f64 = 0.05;

    fn of(points: &[(&CloudPoint, &Match)], pair: &SimulatedPair) -> Self {
        let mut errors_px = Vec::new();
        let (mut squares, mut within, mut useful) = (Vec::new(), 0_usize, 0_usize);
        for (point, found) in points {
            let verdict = Verdict::of(found.left, found.right, pair);
            if verdict.is_right() {
                errors_px.extend(verdict.offset_px.map(f64::abs));
            }
            let range = point.point.mm().norm();
            let sigma = point.sigma_range.mm();
            if sigma > Self::USEFUL * range || !verdict.range_mm.is_finite() {
                continue;
            }
            let off = (range - verdict.range_mm) / sigma;
            useful += 1;
            within += usize::from(off.abs() <= 2.0);
            if verdict.is_right() {
                squares.push(off * off);
            }
        }
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        Self {
            count: points.len(),
            sigma_px: median(points.iter().map(|(_, found)| found.sigma).collect()).unwrap_or_default(),
            spread_px: 1.483 * std::f64::consts::FRAC_1_SQRT_2 * median(errors_px).unwrap_or_default(),
            nees: mean,
            within_two_sigma: within as f64 / useful.max(1) as f64,
        }
    }
}

/// Error of a match.
struct Verdict {
    offset_px: [f64; 2],
    bearing_rad: f64,
    /// True range from the left camera.
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
        let verdicts = places.into_iter().filter_map(truth);
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
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
