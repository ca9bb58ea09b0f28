//! Whether the pose of a pair comes from the joints alone, or from joints and images together.

use nalgebra::Matrix6;
use vergence_alignment::{FusedPose, MatchErrors, fuse_pose};
use vergence_matching::{Match, MatchError, Matcher};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Angle, Left, Length, MatchSigma, PixelPair, Right, StereoPair, Transform};

use crate::limits::{JOINTS_SUFFICE, matching_sigma};
use crate::pair::PairImages;
use crate::pose::PairPose;
use crate::search::Search;

/// The pose that joints and `matches` tell together; `None` where too few agree, or they do not help.
pub(crate) fn fused(rig: &Rig, by_joints: &RigPose, matches: &[(PixelPair, MatchSigma)]) -> Option<FusedPose> {
    let stereo =
        StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: by_joints.left_from_right };
    // The joints' errors move the pose far: matches that the covariance of the joints excludes are not looked at.
    fuse_pose(matches, &stereo, &by_joints.covariance(), MatchErrors::Measured)
        .filter(|fused| fused.rotation_sigma() < by_joints.rotation_sigma)
}

/// Whether the joints tell the rotation of `pose` well enough. What the calibration leaves uncertain is no part of that: one pair of
/// images knows it less well than the many of a calibration, and a misfit of the lens model would turn the pose.
pub(crate) fn joints_suffice(rig: &Rig, pose: &RigPose) -> bool {
    rig.rotation_sigma_of_joints(pose) <= JOINTS_SUFFICE
}

/// `pose` with the relative pose that joints and images tell together.
#[must_use]
pub fn with_fused(pose: &RigPose, fused: &FusedPose) -> RigPose {
    told_otherwise(pose, fused.left_from_right, &fused.covariance)
}

/// `pose` with another relative pose of this covariance.
pub(crate) fn told_otherwise(
    pose: &RigPose,
    left_from_right: Transform<Left, Right>,
    covariance: &Matrix6<f64>,
) -> RigPose {
    let sigma = |first: usize| covariance.fixed_view::<3, 3>(first, first).trace().max(0.0).sqrt();
    RigPose {
        left_from_right,
        shared: pose.shared.with_pose(covariance),
        rotation_sigma: Angle::from_rad(sigma(0)),
        translation_sigma: Length::from_mm(sigma(3)),
        ..pose.clone()
    }
}

/// The pose of a standing rig for the dense search: by joints and the matches that `matcher` finds, where the joints alone tell it
/// too badly. `None` where they suffice, or the images do not help.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn pose_by_images(
    images: PairImages<'_>,
    (rig, search): (&Rig, &Search),
    pose: &RigPose,
    matcher: &dyn Matcher,
) -> Result<Option<FusedPose>, MatchError> {
    if joints_suffice(rig, pose) {
        return Ok(None);
    }
    let standing = PairPose::standing(pose.clone());
    let sigma = matching_sigma(pose, standing.sweep());
    let found = images.with_grey((rig, search), pose, sigma, |pair| matcher.find(pair))?;
    let pairs: Vec<_> = found.pairs.iter().map(Match::measured).collect();
    Ok(fused(rig, pose, &pairs))
}
