//! The search for the pose that meets a depth goal with the widest view.

use serde_json::{Value, json};
use vergence_vision::{Angle, Length, circle_zones};

use crate::axis::AxisPosition;
use crate::depth_field::DepthField;
use crate::goal::{DepthGoal, DepthSigma};
use crate::in_json::{axes_json, rounded};
use crate::linkage::TrunkShape;
use crate::rig::Rig;

/// Step of the azimuths at which the goal is checked.
const DIRECTION_STEP: Angle = Angle::from_deg(1.0);
/// Number of poses of the first grid, over all axes.
const FIRST_GRID: f64 = 700.0;
/// Number of poses kept from grid to grid.
const KEPT: usize = 4;
/// Number of finer grids that follow the first.
const REFINEMENTS: usize = 9;
/// Steps of a finer grid to each side along each axis; the step is a quarter of the one before.
const FINER_GRID: i32 = 4;

/// A pose rated by a [`DepthGoal`].
#[derive(Clone, Debug, PartialEq)]
pub struct RatedPose {
    /// The position of each axis, in millimetres or radians.
    pub values: Vec<f64>,
    /// The largest standard deviation over the goal's directions; `None` where one of them is not seen by both cameras.
    pub worst: Option<Length>,
    /// Angle of the circle at the goal's range that at least one camera sees.
    pub seen: Angle,
    /// Angle of that circle that both cameras see.
    pub stereo: Angle,
    /// Measure of how far the goal is missed; zero where it is met.
    shortfall: f64,
}

impl RatedPose {
    /// Whether the pose meets the goal.
    #[must_use]
    pub fn meets_goal(&self) -> bool {
        self.shortfall <= 0.0
    }

    /// The position of each axis of `rig`.
    #[must_use]
    pub fn positions(&self, rig: &Rig) -> Vec<AxisPosition> {
        rig.axes.iter().zip(&self.values).map(|(axis, &value)| AxisPosition::from_value(axis.kind, value)).collect()
    }

    /// Pose, sigma and view for programs.
    #[must_use]
    pub fn json(&self, rig: &Rig) -> Value {
        json!({
            "meets_goal": self.meets_goal(),
            "pose": axes_json(rig, &self.positions(rig)),
            "worst_sigma_mm": self.worst.map(Length::mm).map(rounded),
            "seen_deg": rounded(self.seen.deg()),
            "stereo_deg": rounded(self.stereo.deg()),
        })
    }

    /// Whether this pose is preferred to `other`: first by the goal met, then by the wider view, then by the smaller
    /// sigma.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        let sigma = |pose: &Self| pose.worst.map_or(f64::INFINITY, Length::mm);
        let by_goal = self.shortfall.max(0.0).total_cmp(&other.shortfall.max(0.0)).reverse();
        let by_view = self.seen.rad().total_cmp(&other.seen.rad());
        by_goal.then(by_view).then(sigma(self).total_cmp(&sigma(other)).reverse()).is_gt()
    }
}

impl Rig {
    /// Rates the pose with the axes at `values` (millimetres or radians) by `goal`, for matches with a standard
    /// deviation of `pixel_sigma` pixels.
    #[must_use]
    pub fn rate_pose(&self, values: &[f64], goal: &DepthGoal, pixel_sigma: f64) -> RatedPose {
        let field = DepthField::new(self, values, pixel_sigma);
        let steps = (goal.half_width.rad() / DIRECTION_STEP.rad()).ceil() as i32;
        let directions = (-steps..=steps).map(|i| goal.half_width * (f64::from(i) / f64::from(steps.max(1))));
        let (mut worst, mut unseen, mut count) = (0.0_f64, 0, 0);
        for azimuth in directions {
            count += 1;
            match field.at(azimuth, Angle::from_rad(0.0), goal.range) {
                Some(predicted) => {
                    let sigma = match goal.sigma {
                        DepthSigma::Forward => predicted.sigma_forward,
                        DepthSigma::Range => predicted.sigma_range,
                    };
                    worst = worst.max(sigma.mm());
                }
                None => unseen += 1,
            }
        }
        let zones =
            circle_zones(&field.cameras(), &field.middle(), goal.range).map(|map| map.zones).unwrap_or_default();
        // An unseen direction counts more than any sigma; their fraction leads the search to poses that see all
        // directions.
        let lacking = (worst / goal.limit.mm() - 1.0).max(0.0);
        let shortfall = lacking / (1.0 + lacking) + f64::from(unseen) / f64::from(count) * 1e3;
        RatedPose {
            values: values.to_vec(),
            worst: (unseen == 0).then_some(Length::from_mm(worst)),
            seen: zones.stereo + zones.mono,
            stereo: zones.stereo,
            shortfall,
        }
    }

    /// Finds the pose that meets `goal` with the widest view, or where none meets it, the one that comes nearest.
    ///
    /// The search runs on grids over the axes' ranges, each finer around the best poses of the one before.
    /// `pixel_sigma` is the standard deviation of matches in pixels.
    #[must_use]
    pub fn best_pose(&self, goal: &DepthGoal, pixel_sigma: f64) -> RatedPose {
        let space = SearchSpace::of(self);
        let ranges = &space.ranges;
        let per_axis = FIRST_GRID.powf(1.0 / ranges.len().max(1) as f64).floor().max(3.0);
        let mut steps: Vec<f64> = ranges.iter().map(|[low, high]| (high - low) / (per_axis - 1.0)).collect();
        let first = |i: usize, k: i32| ranges[i][0] + f64::from(k) * steps[i];
        let mut best: Vec<RatedPose> = Vec::new();
        for place in grid(ranges.len(), 0..per_axis as i32, first) {
            keep(&mut best, self.rate_pose(&space.values(&place), goal, pixel_sigma));
        }
        for _ in 0..REFINEMENTS {
            steps.iter_mut().for_each(|step| *step /= f64::from(FINER_GRID));
            for centre in best.clone() {
                let centre = space.place(&centre.values);
                let around = |i: usize, k: i32| {
                    let [low, high] = ranges[i];
                    (centre[i] + f64::from(k) * steps[i]).clamp(low, high)
                };
                for place in grid(ranges.len(), -FINER_GRID..FINER_GRID + 1, around) {
                    keep(&mut best, self.rate_pose(&space.values(&place), goal, pixel_sigma));
                }
            }
        }
        best.into_iter().next().unwrap_or_else(|| self.rate_pose(&[], goal, pixel_sigma))
    }
}

/// The poses among which the best one is searched: all of a rig with stages; of a trunk the flat ones with both sides alike, which its
/// side joint tells.
struct SearchSpace<'a> {
    rig: &'a Rig,
    /// Range of each coordinate.
    ranges: Vec<[f64; 2]>,
}

impl<'a> SearchSpace<'a> {
    fn of(rig: &'a Rig) -> Self {
        let whole = || rig.axes.iter().map(|axis| axis.range.map(|end| end.value())).collect();
        Self { rig, ranges: rig.trunk.as_ref().map_or_else(whole, |trunk| vec![trunk.side_joints_alike()]) }
    }

    /// Positions of all axes at a place of the space.
    fn values(&self, place: &[f64]) -> Vec<f64> {
        match (&self.rig.trunk, place) {
            (Some(trunk), [side]) => {
                trunk.values_of(&TrunkShape::alike(*side, std::f64::consts::PI), self.rig.axes.len())
            }
            _ => place.to_vec(),
        }
    }

    /// The place of the space with these positions of all axes.
    fn place(&self, values: &[f64]) -> Vec<f64> {
        let side = self.rig.trunk.as_ref().and_then(|trunk| values.get(trunk.axes[1]));
        side.map_or_else(|| values.to_vec(), |&side| vec![side])
    }
}

/// All combinations of `value(axis, index)` over the axes.
fn grid(axes: usize, indices: std::ops::Range<i32>, value: impl Fn(usize, i32) -> f64) -> Vec<Vec<f64>> {
    (0..axes).fold(vec![Vec::new()], |poses, axis| {
        let longer = |pose: &Vec<f64>| -> Vec<Vec<f64>> {
            indices.clone().map(|k| pose.iter().copied().chain([value(axis, k)]).collect()).collect()
        };
        poses.iter().flat_map(longer).collect()
    })
}

/// Inserts `pose` in order among the best; of equal poses the first found stays ahead.
fn keep(best: &mut Vec<RatedPose>, pose: RatedPose) {
    if best.iter().any(|other| other.values == pose.values) {
        return;
    }
    let place = best.iter().position(|other| pose.is_better_than(other)).unwrap_or(best.len());
    best.insert(place, pose);
    best.truncate(KEPT);
}
