//! What the uncertainty of lenses and pose does to disparities, on a coarse grid of directions and ranges: it changes slowly over both.

use std::sync::OnceLock;

use nalgebra::Vector3;
use vergence_vision::{Left, Point, PointUncertainty, SharedCovariance, StereoPair, Transform};

use crate::shared_frame::{Shared, SharedFrame};

/// Distance of the nodes in both angles, in radians, and their numbers: across the baseline, and all around it.
const STEP: f64 = 0.07;
const ACROSS: usize = 45;
const AROUND: usize = 91;
/// Distance of the nodes in the baseline over the range from the right camera, and their number.
const NEARER: f64 = 0.125;
const LEVELS: usize = 13;
/// In place of the level at infinity.
const FARTHEST: f64 = 1e-3;

/// Variances of disparities in rad², by the errors that all points share.
pub(super) struct SharedSpread<'a> {
    pair: StereoPair<'a>,
    shared: &'a SharedCovariance,
    left_from_shared: Transform<Left, Shared>,
    baseline_mm: f64,
    /// By level, then by b, then by a. A node is computed when it is first asked for: a pair has points near some of them only.
    variances: Vec<OnceLock<f64>>,
}

impl<'a> SharedSpread<'a> {
    /// The grid for `pair`, whose shared axes are `frame`'s.
    pub(super) fn new(frame: &SharedFrame, pair: &StereoPair<'a>, shared: &'a SharedCovariance) -> Self {
        Self {
            pair: *pair,
            shared,
            left_from_shared: frame.shared_from_left().inverse(),
            baseline_mm: frame.baseline().mm(),
            variances: vec![OnceLock::new(); LEVELS * AROUND * ACROSS],
        }
    }

    /// The variance at a node; NaN where no point is there.
    fn node(&self, [a, b, level]: [usize; 3]) -> f64 {
        let computed = || {
            let nearness = if level == 0 { FARTHEST } else { NEARER * level as f64 };
            let baseline_mm = self.baseline_mm;
            let node =
                Node { a: angle(a, ACROSS), b: angle(b, AROUND), from_right: baseline_mm / nearness, baseline_mm };
            node.variance(&self.left_from_shared, &self.pair, self.shared).unwrap_or(f64::NAN)
        };
        *self.variances[(level * AROUND + b) * ACROSS + a].get_or_init(computed)
    }

    /// The variance for a point in the direction (a, b) of the left view, whose range from the right camera is the baseline over
    /// `nearness`. NaN outside of the grid.
    pub(super) fn at(&self, [a, b]: [f64; 2], nearness: f64) -> f64 {
        let places = [a / STEP + (ACROSS / 2) as f64, b / STEP + (AROUND / 2) as f64, nearness / NEARER];
        let last = [ACROSS - 1, AROUND - 1, LEVELS - 1];
        if places.iter().zip(last).any(|(place, last)| !(0.0..=last as f64).contains(place)) {
            return f64::NAN;
        }
        let low: [usize; 3] = std::array::from_fn(|axis| (places[axis] as usize).min(last[axis] - 1));
        (0..8)
            .map(|corner| {
                let high: [usize; 3] = std::array::from_fn(|axis| corner >> axis & 1);
                let weight: f64 = (0..3)
                    .map(|axis| {
                        let part = places[axis] - low[axis] as f64;
                        if high[axis] == 1 { part } else { 1.0 - part }
                    })
                    .product();
                weight * self.node(std::array::from_fn(|axis| low[axis] + high[axis]))
            })
            .sum()
    }
}

fn angle(node: usize, nodes: usize) -> f64 {
    (node as f64 - (nodes / 2) as f64) * STEP
}

/// A direction of the left view and a range.
struct Node {
    a: f64,
    b: f64,
    from_right: f64,
    baseline_mm: f64,
}

impl Node {
    fn variance(
        &self,
        left_from_shared: &Transform<Left, Shared>,
        pair: &StereoPair<'_>,
        shared: &SharedCovariance,
    ) -> Option<f64> {
        let Self { a, b, from_right, baseline_mm } = *self;
        // With μ sin d = B cos a, as in `range`.
        let sine = baseline_mm * a.cos() / from_right;
        if a.cos() <= 0.0 || sine >= 1.0 {
            return None;
        }
        let disparity = sine.asin();
        let range = baseline_mm * (a - disparity).cos() / sine;
        let along = Vector3::new(a.sin(), a.cos() * b.sin(), a.cos() * b.cos());
        let point: Point<Left> = *left_from_shared * Point::from_mm(along * range);
        let uncertain = PointUncertainty::of(&point, pair, 0.0)?;
        let along = point.mm().normalize();
        let of_range = along.dot(&(uncertain.covariance_with(&uncertain, shared) * along));
        Some(of_range.max(0.0) / (from_right / sine).powi(2))
    }
}
