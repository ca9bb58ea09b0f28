//! Where axes stand that no encoder tells, as one pair of images tells it.
//!
//! The pose follows an axis along a curve, but [`fuse_pose`] takes the covariance of the joints as that of a straight line. So the
//! images are looked at from several positions of an axis that is known badly, each near enough to match and to be taken as straight,
//! and the position that most matches agree with is narrowed to what they tell. The pose is then told anew around it, by images and
//! joints together.
//!
//! With c the way from the pose by the joints to the one found, whose covariances are P and C, and s the change of the pose with an
//! axis, off by a standard deviations: a has the mean sᵀ P⁻¹ c and the variance 1 - sᵀ P⁻¹ (P - C) P⁻¹ s.

use vergence_alignment::{FusedPose, MatchErrors, fuse_pose};
use vergence_matching::{Match, MatchError, Matcher};
use vergence_rig::{JointsAt, Rig};
use vergence_vision::{Angle, StereoPair};

use crate::limits::matching_sigma;
use crate::pair::PairImages;
use crate::search::Search;

/// Standard deviation of the rotation with which the images are looked at from one position of an axis.
const LOOK: Angle = Angle::from_deg(3.0);
/// Turn from one position to the next.
const LOOK_STEP: Angle = Angle::from_deg(4.0);
/// Positions further away than this, in standard deviations, are not looked at.
const FARTHEST: f64 = 2.5;
/// How many standard deviations of what the images tell are left open around it. What the joints say within them counts a second time,
/// but hardly weighs.
const LEFT_OPEN: f64 = 20.0;
/// Least turn that is left open: enough for the images to be asked again.
const LEAST_OPEN: Angle = Angle::from_deg(0.5);

/// Where an axis stands by joints and images together, in counts, and the standard deviation of that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisEstimate {
    /// The position.
    pub counts: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Narrows `joints`, of which some are known badly, to what a pair of images tells of them. `None` where no position of them makes
/// enough matches agree.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn axes_by_images(
    images: PairImages<'_>,
    (rig, search): (&Rig, &Search),
    joints: &JointsAt,
    matcher: &dyn Matcher,
) -> Result<Option<JointsAt>, MatchError> {
    Ok(best_look(images, (rig, search), joints, matcher)?.map(|look| look.joints))
}

/// What the images told from the position with which most of their matches agree.
pub(crate) struct Look {
    /// The joints, narrowed to it.
    pub joints: JointsAt,
    /// The pose by the matches from there.
    pub fused: FusedPose,
}

/// Looks at the images from all positions that `joints` allow.
pub(crate) fn best_look(
    images: PairImages<'_>,
    (rig, search): (&Rig, &Search),
    joints: &JointsAt,
    matcher: &dyn Matcher,
) -> Result<Option<Look>, MatchError> {
    let mut best: Option<(usize, JointsAt, FusedPose)> = None;
    for look in looks(rig, joints) {
        let pose = rig.pose(&look);
        let sigma = matching_sigma(&pose, Angle::from_rad(0.0));
        let found = match images.with_grey((rig, search), &pose, sigma, |pair| matcher.find(pair)) {
            Ok(found) => found,
            // Somewhere in the range of the axis the cameras may share no field.
            Err(MatchError::NoSharedField | MatchError::NoBaseline) => continue,
            Err(error) => return Err(error),
        };
        let pairs: Vec<_> = found.pairs.iter().map(Match::measured).collect();
        let pair =
            StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
        let Some(fused) = fuse_pose(&pairs, &pair, &pose.covariance(), MatchErrors::Measured) else { continue };
        let agreeing = (fused.agreeing * pairs.len() as f64).round() as usize;
        if best.as_ref().is_none_or(|(most, ..)| agreeing > *most) {
            best = Some((agreeing, look, fused));
        }
    }
    Ok(best.map(|(_, look, fused)| Look { joints: narrowed(rig, joints, &look, &fused), fused }))
}

/// Where each axis stands by the pose that joints and images tell together.
#[must_use]
pub fn axis_estimates(rig: &Rig, joints: &JointsAt, fused: &FusedPose) -> Vec<AxisEstimate> {
    let prior = rig.pose(joints).covariance();
    let estimate = |(index, (&counts, &sigma)): (usize, (&f64, &f64))| {
        let by_joints = AxisEstimate { counts, sigma };
        let Some(factors) = prior.cholesky().filter(|_| sigma > 0.0) else { return by_joints };
        let slope = rig.pose_change(joints, index, sigma);
        let gain = factors.solve(&slope);
        let variance = 1.0 - slope.dot(&gain) + gain.dot(&(fused.covariance * gain));
        AxisEstimate { counts: counts + sigma * gain.dot(&fused.correction), sigma: sigma * variance.max(0.0).sqrt() }
    };
    joints.counts.iter().zip(&joints.sigma).enumerate().map(estimate).collect()
}

/// The positions from which the images are looked at: several of the axis whose error turns the cameras most, where that is too far for
/// one look.
fn looks(rig: &Rig, joints: &JointsAt) -> Vec<JointsAt> {
    let turn = |index: usize, counts: f64| rig.pose_change(joints, index, counts).fixed_rows::<3>(0).norm();
    let turns = joints.sigma.iter().enumerate().map(|(index, &sigma)| (index, sigma, turn(index, sigma)));
    let Some((index, sigma, by_sigma)) = turns.max_by(|one, other| one.2.total_cmp(&other.2)) else {
        return vec![joints.clone()];
    };
    if by_sigma <= LOOK.rad() {
        return vec![joints.clone()];
    }
    let (step, steps) = (sigma * LOOK_STEP.rad() / by_sigma, (FARTHEST * by_sigma / LOOK_STEP.rad()).ceil() as i32);
    let at = |step_number: i32| {
        let mut look = joints.clone();
        look.counts.iter_mut().skip(index).take(1).for_each(|counts| *counts += step * f64::from(step_number));
        look.sigma.iter_mut().skip(index).take(1).for_each(|of_axis| *of_axis = sigma * LOOK.rad() / by_sigma);
        look
    };
    let is_in_range = |look: &JointsAt| {
        rig.axes.iter().zip(&look.counts).nth(index).is_some_and(|(axis, &counts)| {
            let [low, high] = axis.range.map(|end| end.value());
            (low..=high).contains(&axis.value_at(counts))
        })
    };
    (-steps..=steps).map(at).filter(is_in_range).collect()
}

/// `joints` where `look` and the pose found from it say that they are. Axes of which the images tell little stay as they are.
fn narrowed(rig: &Rig, joints: &JointsAt, look: &JointsAt, fused: &FusedPose) -> JointsAt {
    let stated = joints.counts.iter().zip(&joints.sigma);
    let turn = |index: usize, counts: f64| rig.pose_change(look, index, counts).fixed_rows::<3>(0).norm();
    let found = axis_estimates(rig, look, fused).into_iter().enumerate();
    let each = found.zip(stated).map(|((index, found), (&counts, &sigma))| {
        let open = (LEFT_OPEN * found.sigma).max(sigma * LEAST_OPEN.rad() / turn(index, sigma));
        if open < sigma { (found.counts, open) } else { (counts, sigma) }
    });
    let (counts, sigma) = each.unzip();
    JointsAt { counts, sigma, timing: joints.timing.clone() }
}
