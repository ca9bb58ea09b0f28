//! The play of the joints, from how far their readings are from where the images and the closed loop put them.
//!
//! Estimation of variance components: the sum of squared residuals of a group of readings over their redundancy (W. Förstner, "Ein
//! Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten", Allg. Vermessungs-Nachrichten 86, 1979). It is made a little larger,
//! so that its inverse is right in the mean and a few readings do not look surer than they are.

use std::ops::Range;

use nalgebra::DMatrix;
use vergence_rig::TRUNK_AXES;
use vergence_rig::linkage::TrunkJoint;
use vergence_vision::median;

use crate::extrinsics::ExtrinsicsCalibration;
use crate::schur_lm::{self, SchurOptions};
use crate::stage::start::{ToPoses, measured};
use crate::trunk::model::{Model, State, first_joint};

/// Joints that share a play: the three corners, and the two folds.
const GROUPS: [Range<usize>; 2] = [0..3, 3..TRUNK_AXES];
/// Least redundancy of a group from which its play is estimated; below it the drawing's holds.
const ENOUGH: f64 = 6.0;
/// What is taken off the redundancy, so that the inverse of the estimate has no bias: the kurtosis of errors spread evenly over a play,
/// 1.8, less one. Of normal errors, which know no end, it would be 2.
const EVEN: f64 = 0.8;
/// Rounds after which the estimate stands; each brings it nearer by an order of magnitude.
const ROUNDS: usize = 15;
/// A change of a factor that no longer matters.
const SETTLED: f64 = 1e-3;
/// A stage pose is strained where the mean square of its joints' errors is this many times that of play. Of two normal errors one
/// in 3000 is.
const STRAINED: f64 = 8.0;
/// Median over mean of the mean square of two normal errors: ln 2.
const MEDIAN_OVER_MEAN: f64 = std::f64::consts::LN_2;

/// What the readings of a group of joints tell of their play.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayFound {
    /// Ratio of the standard deviation of a reading to that which the rig file states; 1 where the stage poses are too few to tell.
    pub factor: f64,
    /// Number of readings beyond those that the unknowns need, strained stage poses left out.
    pub redundancy: f64,
    /// Whether each stage pose is strained: its joints are further off than play explains, because the loop does not close as the
    /// encoders say and something gives. Its readings count as far as they are off.
    pub strained: Vec<bool>,
}

impl PlayFound {
    /// Whether the readings to spare were enough to tell.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.redundancy >= ENOUGH
    }
}

/// The trunk that fits the stage poses best, with the play of its joints estimated beside it: `model` gets their readings' standard
/// deviations. `None` if the iteration does not converge.
pub(crate) fn fitted_to_poses(model: &mut Model, alone: &[ExtrinsicsCalibration]) -> Option<(State, [PlayFound; 2])> {
    let measured = measured(alone)?;
    let stated = model.reading_sigma.clone();
    let none = || PlayFound { factor: 1.0, redundancy: 0.0, strained: vec![false; stated.len()] };
    let mut found = [none(), none()];
    let mut state = model.nominal();
    for round in 0..ROUNDS {
        let problem = ToPoses { kinematics: &*model, measured: &measured };
        let solution = schur_lm::solve(&problem, state, Vec::new(), &SchurOptions::default());
        if !solution.cost.is_finite() {
            return None;
        }
        state = solution.shared;
        let covariance = solution.normal.shared_covariance()?;
        let before = [found[0].factor, found[1].factor];
        for (found, group) in found.iter_mut().zip(&GROUPS) {
            let shares = shares(model, &state, &covariance, &stated, group);
            *found = estimate(&shares, found, round == 0);
            for (pose, share) in shares.iter().enumerate() {
                let strained = found.strained.get(pose) == Some(&true);
                let factor = if strained { share.mean().sqrt().max(found.factor) } else { found.factor };
                for joint in group.clone() {
                    model.reading_sigma[pose][joint] = stated[pose][joint] * factor;
                }
            }
        }
        if round > 0 && before.iter().zip(&found).all(|(before, now)| (now.factor / before - 1.0).abs() < SETTLED) {
            break;
        }
    }
    Some((state, found))
}

/// What one stage pose tells of the play of a group.
struct Share {
    /// Sum of the squares of the readings' errors, each over its stated variance.
    squares: f64,
    /// Number of readings beyond those that the unknowns need.
    redundancy: f64,
}

impl Share {
    fn mean(&self) -> f64 {
        self.squares / self.redundancy.max(0.1)
    }
}

/// The shares of all stage poses at `state`, whose unknowns have this covariance.
fn shares(
    model: &Model,
    state: &State,
    covariance: &DMatrix<f64>,
    stated: &[[f64; TRUNK_AXES]],
    group: &Range<usize>,
) -> Vec<Share> {
    let of_pose = |(pose, readings): (usize, &[f64; TRUNK_AXES])| {
        let errors = state.reading_errors(pose, readings);
        let mut share = Share { squares: 0.0, redundancy: 0.0 };
        for joint in group.clone() {
            let (zero, angle) = (joint, first_joint(pose) + TrunkJoint::DRIVEN[joint].index());
            let known = covariance[(zero, zero)] + 2.0 * covariance[(zero, angle)] + covariance[(angle, angle)];
            share.squares += (errors[joint] / stated[pose][joint]).powi(2);
            share.redundancy += (1.0 - known / model.reading_sigma[pose][joint].powi(2)).clamp(0.0, 1.0);
        }
        share
    };
    model.readings.iter().enumerate().map(of_pose).collect()
}

/// The estimate of a group by the shares of the stage poses that are not strained; `first` where nothing is known of strain yet.
fn estimate(shares: &[Share], now: &PlayFound, first: bool) -> PlayFound {
    let enough = shares.iter().map(|share| share.redundancy).sum::<f64>() >= ENOUGH;
    let typical = if first && enough {
        median(shares.iter().map(Share::mean).collect()).unwrap_or(1.0) / MEDIAN_OVER_MEAN
    } else {
        now.factor.powi(2)
    };
    let strained: Vec<bool> = shares.iter().map(|share| share.mean() > STRAINED * typical).collect();
    let slack = || shares.iter().zip(&strained).filter(|(_, strained)| !**strained).map(|(share, _)| share);
    let redundancy: f64 = slack().map(|share| share.redundancy).sum();
    let squares: f64 = slack().map(|share| share.squares).sum();
    let factor = if redundancy < ENOUGH { 1.0 } else { (squares / (redundancy - EVEN)).sqrt() };
    // A reading is never better than its encoder shows: a factor of zero would make it exact.
    PlayFound { factor: factor.max(1e-2), redundancy, strained }
}
