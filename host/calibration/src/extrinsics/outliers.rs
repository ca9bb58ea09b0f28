//! Outliers: gross corners and gross views.
//!
//! A gross corner contradicts the other corners of its own image: each image is given its own target pose, so that a
//! pair whose images were not taken at the same instant does not make its corners gross. A gross view is one on which
//! the two cameras disagree altogether, such as a target counted from another end.

use nalgebra::Isometry3;
use vergence_targets::Corner;
use vergence_vision::median;

use crate::extrinsics::StereoView;
use crate::extrinsics::stereo::Lenses;
use crate::planar_pose::{errors_px, refined};
use crate::{Loss, TargetShape};

/// A corner further off than this many medians is gross: 7 standard deviations of a Gaussian error.
const GROSS_CORNER: f64 = 6.0;
/// A view whose median error is this many medians is gross. A hand-held pair taken a moment apart stays far below.
const GROSS_VIEW: f64 = 30.0;
/// Errors below this are never gross, in pixels or relative sigmas.
const NEVER_GROSS: f64 = 0.01;
/// Least number of corners for a view to have a target pose of its own.
const FEWEST_CORNERS: usize = 4;

/// The target as each camera alone places it: in the left and in the right frame.
pub(crate) type OwnPoses = [Isometry3<f64>; 2];

/// Median of the errors for which `counted` holds; never zero, so that it can be the scale of a loss.
pub(crate) fn median_of(errors: &[Vec<f64>], counted: &[Vec<bool>]) -> f64 {
    const SMALLEST: f64 = 1e-6;
    let pairs = errors.iter().flatten().zip(counted.iter().flatten());
    let errors = pairs.filter(|(_, counted)| **counted).map(|(error, _)| *error).collect();
    median(errors).unwrap_or(0.0).max(SMALLEST)
}

/// The usable corners that are not gross. `joint_errors_px` are those of the joint fit.
pub(crate) fn inliers(
    lenses: &Lenses,
    views: &[StereoView],
    (own_poses, shape): (&[OwnPoses], &TargetShape),
    joint_errors_px: &[Vec<f64>],
    usable: &[Vec<bool>],
) -> Vec<Vec<bool>> {
    let own: Vec<Vec<f64>> = views
        .iter()
        .zip(own_poses)
        .zip(usable)
        .map(|((view, poses), usable)| own_deviations(lenses, view, (poses, shape), usable))
        .collect();
    let corner_limit = (GROSS_CORNER * median_of(&own, usable)).max(NEVER_GROSS);
    let view_limit = (GROSS_VIEW * median_of(joint_errors_px, usable)).max(NEVER_GROSS);
    let judge = |((own, joint), usable): ((&Vec<f64>, &Vec<f64>), &Vec<bool>)| {
        let fine: Vec<bool> = own.iter().zip(usable).map(|(&error, &usable)| usable && error <= corner_limit).collect();
        let enough = fine.iter().filter(|&&fine| fine).count() >= FEWEST_CORNERS;
        let agrees = median(joint.clone()).is_some_and(|error| error <= view_limit);
        if enough && agrees { fine } else { vec![false; fine.len()] }
    };
    own.iter().zip(joint_errors_px).zip(usable).map(judge).collect()
}

/// Distance of each corner from where the rest of its own image places it, in units of its relative sigma.
fn own_deviations(
    lenses: &Lenses,
    view: &StereoView,
    (poses, shape): (&OwnPoses, &TargetShape),
    usable: &[bool],
) -> Vec<f64> {
    let (left_usable, right_usable) = usable.split_at(view.left.corners.len().min(usable.len()));
    let sides = [
        (&lenses.left, &view.left.corners, &poses[0], left_usable),
        (&lenses.right, &view.right.corners, &poses[1], right_usable),
    ];
    let errors = sides.into_iter().flat_map(|(lens, corners, start, usable)| {
        let kept: Vec<Corner> = corners.iter().zip(usable).filter(|(_, usable)| **usable).map(|(c, _)| *c).collect();
        let deviations = |corners: &[Corner], pose: &Isometry3<f64>| -> Vec<f64> {
            let errors = errors_px(lens, (corners, shape), pose).into_iter().zip(corners);
            errors.map(|(error, corner)| corner.deviation(error)).collect()
        };
        let scale = median(deviations(&kept, start)).unwrap_or(0.0).max(NEVER_GROSS);
        let pose = refined(lens, (&kept, shape), *start, Loss::Cauchy(scale)).map_or(*start, |(pose, _)| pose);
        deviations(corners, &pose)
    });
    errors.collect()
}
