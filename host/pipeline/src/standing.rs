//! The pose of a rig that stands, told better by each pair of images.
//!
//! Matches of earlier pairs stay true as long as the axes stand, also where the scene moves: a match tells of its epipolar plane alone.
//! So the pose is found anew from the matches of the latest pairs together, with what was known of it before any image counted once.
//! Pairs of the same view share their keypoints, and with them errors of registration and of the lens: they are not independent.
//! [`vergence_alignment::fuse_pose`] measures that: it takes the variance from sums over cells of the image, and what is alike in all pairs adds up within a
//! cell in full, so that it does not vanish by repetition.

use std::collections::VecDeque;

use vergence_alignment::FusedPose;
use vergence_rig::{Rig, RigAxis, RigPose};
use vergence_vision::{MatchSigma, PixelPair};

use crate::limits::FLICKER_COUNTS;
use crate::pose::PairPose;
use crate::pose_source::{fused, joints_suffice, with_fused};
use crate::visits::Visits;

/// Number of pairs whose matches are kept. What more pairs of one view would add is lost in what they have in common.
const PAIRS: usize = 10;
/// χ² of six components with a probability of 1e-4: two poses that differ by more are two poses.
const DIFFERENT: f64 = 27.86;

/// What is known of the pose of a rig as long as it stands.
#[derive(Clone, Debug, Default)]
pub struct StandingPose {
    /// Where the axes stand, in millimetres or radians.
    axes: Vec<f64>,
    /// Matches of the latest pairs, each with its standard deviations in pixels.
    pairs: VecDeque<Vec<(PixelPair, MatchSigma)>>,
    /// The pose by joints and all these matches.
    refined: Option<FusedPose>,
    /// The pose by the joints, where the rig stands.
    by_joints: Option<RigPose>,
    /// What images told where the rig stood before.
    visits: Visits,
}

impl StandingPose {
    /// The number of pairs that tell the pose; 0 where the joints tell it alone.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// The pose by joints and images; `None` where the joints suffice, or the images do not help.
    #[must_use]
    pub const fn refined(&self) -> Option<&FusedPose> {
        self.refined.as_ref()
    }

    /// Forgets what images told of this place and of all others.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The number of earlier visits to the place of `by_joints` that told its pose.
    #[must_use]
    pub fn visits(&self, rig: &Rig, by_joints: &RigPose) -> usize {
        self.visits.count(rig, by_joints)
    }

    /// Begins anew, and knows at the next visit what this one told.
    fn leave(&mut self, rig: &Rig) {
        let mut visits = std::mem::take(&mut self.visits);
        if let (Some(by_joints), Some(told)) = (&self.by_joints, &self.refined) {
            visits.keep(rig, by_joints, told);
        }
        *self = Self { visits, ..Self::default() };
    }

    /// Leaves the place where the axes of `rig` read another position at `pose`, or move.
    pub(crate) fn forget_if_moved(&mut self, rig: &Rig, pose: &PairPose) {
        let at = pose.at_middle().axes.iter().map(|axis| axis.value());
        let moved = |((axis, before), now): ((&RigAxis, &f64), f64)| {
            (now - before).abs() > FLICKER_COUNTS * axis.value_per_count().abs()
        };
        if !pose.is_steady() || rig.axes.iter().zip(&self.axes).zip(at).any(moved) {
            self.leave(rig);
        }
    }

    /// The pose that is known best, by joints, earlier visits and images.
    pub(crate) fn best(&self, rig: &Rig, by_joints: &RigPose) -> RigPose {
        match &self.refined {
            Some(fused) => with_fused(by_joints, fused),
            None => self.visits.corrected(rig, by_joints),
        }
    }

    /// Takes the matches of one more pair. `false` where they contradict the pairs before, which are then forgotten: the cameras have moved
    /// and no encoder told it. Earlier visits are forgotten too where they exclude what the matches say: a mount has moved.
    pub(crate) fn take(&mut self, rig: &Rig, pose: &PairPose, matches: &[(PixelPair, MatchSigma)]) -> bool {
        let middle = pose.at_middle();
        if joints_suffice(rig, middle) || !pose.is_steady() {
            self.leave(rig);
            return true;
        }
        let known = self.visits.corrected(rig, middle);
        let alone = fused(rig, &known, matches);
        let has_moved = match (&self.refined, &alone) {
            (Some(refined), Some(alone)) => are_different(refined, alone),
            (Some(_), None) => true,
            (None, _) => false,
        };
        if has_moved {
            // Within their play and counts the joints creep, which says nothing of the calibration.
            *self = Self { visits: std::mem::take(&mut self.visits), ..Self::default() };
            return false;
        }
        if self.visits.count(rig, middle) > 0 && alone.as_ref().is_some_and(|alone| is_excluded(&known, alone)) {
            self.forget();
            return false;
        }
        if alone.is_none() {
            return true;
        }
        if self.pairs.is_empty() {
            self.axes = middle.axes.iter().map(|axis| axis.value()).collect();
            self.by_joints = Some(middle.clone());
        }
        if self.pairs.len() == PAIRS {
            self.pairs.pop_front();
        }
        self.pairs.push_back(matches.to_vec());
        let all: Vec<_> = self.pairs.iter().flatten().copied().collect();
        self.refined = if self.pairs.len() == 1 { alone } else { fused(rig, &known, &all).or(alone) };
        true
    }
}

/// Whether images say that the pose is not the `known` one, by more than that is uncertain.
fn is_excluded(known: &RigPose, found: &FusedPose) -> bool {
    let factors = known.covariance().cholesky();
    factors.is_some_and(|factors| found.correction.dot(&factors.solve(&found.correction)) > DIFFERENT)
}

/// Whether two poses of the same joints differ by more than both are uncertain. They share what the joints tell, so that the sum of
/// their covariances is more than their difference has.
fn are_different(one: &FusedPose, other: &FusedPose) -> bool {
    let way = one.way_to(&other.left_from_right);
    let both = one.covariance + other.covariance;
    both.cholesky().is_some_and(|factors| way.dot(&factors.solve(&way)) > DIFFERENT)
}
