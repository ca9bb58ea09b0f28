//! A rig that stands, where no encoder tells some of its axes: each pair of images tells them, and adds to what the pairs before told.
//!
//! The first pair is looked at around the last readings. Where it does not agree with them, somebody has moved the axes, and they are
//! looked for in all of their ranges. What is found stands for readings as long as the images agree with it.

use vergence_alignment::FusedPose;
use vergence_matching::{MatchError, Matcher};
use vergence_rig::{AxisPosition, JointsAt, Rig};
use vergence_vision::Angle;

use crate::axes_by_images::{Look, axes_by_images, axis_estimates, best_look};
use crate::cloud::{Method, PairCloudError, refined_cloud};
use crate::limits::FLICKER_COUNTS;
use crate::memory::PoseMemory;
use crate::observation::Observation;
use crate::pair::PairImages;
use crate::pose::PairPose;
use crate::search::Search;

/// Standard deviation of the rotation with which the images are first looked at, around the last reading of an axis.
const NEAR: Angle = Angle::from_deg(1.5);
/// What lies further from the last readings than so many of these standard deviations is not near: matches that agree half on the way draw the
/// axis away from where it is.
const MOST_OFF: f64 = 2.0;
/// Part of the matches that must agree there. Where an axis is elsewhere, matches agree by chance.
const AGREEING: f64 = 0.5;
/// An axis that turns the cameras by less than this with a count, in radians, does not turn them at all.
const SLIDES: f64 = 1e-12;

/// The readings of a rig that stands, some of which tell nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct UntoldAxes {
    /// The joints; in place of readings that tell nothing, the last ones that did.
    pub joints: JointsAt,
    /// Indices of the axes that no encoder tells.
    pub axes: Vec<usize>,
}

/// An axis as the images tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisByImages {
    /// Index of the axis.
    pub axis: usize,
    /// Where it stands.
    pub at: AxisPosition,
    /// Standard deviation of that.
    pub sigma: AxisPosition,
}

impl UntoldAxes {
    /// The joints, those that no encoder tells as uncertain as somewhere in their range; those that turn the cameras only as uncertain as
    /// `turn`, where that is given.
    fn within(&self, rig: &Rig, turn: Option<Angle>) -> JointsAt {
        let mut joints = self.joints.clone();
        for &index in &self.axes {
            let Some(axis) = rig.axes.get(index) else { continue };
            let turned = |sigma: f64| rig.pose_change(&self.joints, index, sigma).fixed_rows::<3>(0).norm();
            let anywhere = axis.sigma_of_range();
            let (counts, sigma) = match turn {
                _ if turned(1.0) < SLIDES => (joints.counts[index], anywhere),
                Some(turn) => (joints.counts[index], anywhere.min(turn.rad() / turned(1.0))),
                None => {
                    let [low, high] = axis.range.map(AxisPosition::value);
                    (axis.counts_at(0.5 * (low + high)), anywhere)
                }
            };
            (joints.counts[index], joints.sigma[index]) = (counts, sigma);
        }
        joints
    }

    /// Where a pair of images says that the axes stand; `None` where it does not tell.
    fn found(
        &self,
        images: PairImages<'_>,
        (rig, search): (&Rig, &Search),
        matcher: &dyn Matcher,
    ) -> Result<Option<JointsAt>, MatchError> {
        let readings = self.within(rig, Some(NEAR));
        let near = best_look(images, (rig, search), &readings, matcher)?;
        let is_near = |look: &Look| {
            let told = axis_estimates(rig, &readings, &look.fused);
            let is_near =
                |&axis: &usize| (told[axis].counts - readings.counts[axis]).abs() <= MOST_OFF * readings.sigma[axis];
            self.axes.iter().all(is_near)
        };
        match near.filter(|look| look.fused.agreeing >= AGREEING && is_near(look)) {
            Some(look) => Ok(Some(look.joints)),
            None => axes_by_images(images, (rig, search), &self.within(rig, None), matcher),
        }
    }

    /// Whether `found` is of these readings.
    fn stand_at(&self, found: &JointsAt) -> bool {
        let readings = self.joints.counts.iter().zip(&found.counts).enumerate();
        let mut told = readings.filter(|(index, _)| !self.axes.contains(index));
        told.all(|(_, (now, then))| (now - then).abs() <= FLICKER_COUNTS)
    }
}

/// The points of a pair of a rig that stands, some of whose axes are told by the images alone. `None` where they do not tell them.
///
/// # Errors
/// As [`refined_cloud`].
pub fn observe_untold(
    images: PairImages<'_>,
    rig: &Rig,
    untold: &UntoldAxes,
    method: Method<'_>,
    memory: &mut PoseMemory,
) -> Result<Option<Observation>, PairCloudError> {
    if memory.found.as_ref().is_none_or(|found| !untold.stand_at(found)) {
        memory.forget();
    }
    // What was found before may hold no more: then the axes are looked for once again.
    for _ in 0..2 {
        let is_new = memory.found.is_none();
        if is_new {
            memory.found = untold.found(images, (rig, method.search), method.matcher)?;
        }
        let Some(joints) = memory.found.clone() else { return Ok(None) };
        let pose = PairPose::standing(rig.pose(&joints));
        let cloud = refined_cloud(images, rig, &pose, method, &mut memory.standing, &mut |_| ())?;
        let holds = is_new || cloud.told_by_pairs > 1;
        if let Some(fused) = cloud.fused_pose.filter(|fused| holds && fused.agreeing >= AGREEING) {
            let by_images = axes_told(rig, &joints, Some(&fused), &untold.axes);
            let mut used = cloud.pose(pose.at_middle());
            for told in &by_images {
                used.axes.iter_mut().skip(told.axis).take(1).for_each(|at| *at = told.at);
            }
            return Ok(Some(Observation::Points {
                cloud: Box::new(cloud),
                pose: Box::new(used),
                moving: false,
                by_images,
            }));
        }
        memory.forget();
    }
    Ok(None)
}

/// Where `axes` stand by `joints` and the pose that joints and images told together; by `joints` alone where that is missing.
#[must_use]
pub fn axes_told(rig: &Rig, joints: &JointsAt, fused: Option<&FusedPose>, axes: &[usize]) -> Vec<AxisByImages> {
    let found = fused.map(|fused| axis_estimates(rig, joints, fused));
    let told = |&index: &usize| {
        let axis = rig.axes.get(index)?;
        let by_joints = || Some((*joints.counts.get(index)?, *joints.sigma.get(index)?));
        let (counts, sigma) = match &found {
            Some(found) => found.get(index).map(|found| (found.counts, found.sigma)),
            None => by_joints(),
        }?;
        let position = |value| AxisPosition::from_value(axis.kind, value);
        let (at, sigma) = (position(axis.value_at(counts)), position(sigma * axis.value_per_count()));
        Some(AxisByImages { axis: index, at, sigma })
    };
    axes.iter().filter_map(told).collect()
}
