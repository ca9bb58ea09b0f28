//! Measurement while the stages move, where every row of both images has its own pose.

use vergence_vision::{
    Angle, Base, Cloud, CloudPoint, DropReason, Gates, Left, MatchSigma, PixelPair, SharedCovariance, StereoPair,
    Transform, cloud_point,
};

use crate::exposure::PairExposure;
use crate::pose::RigPose;
use crate::rig::Rig;
use crate::track::{Joints, JointsAt, TrackGap};

/// The pose of the cameras at the exposure of the middle rows of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct MiddlePose {
    /// The pose, with each camera at the exposure of its own middle row.
    pub pose: RigPose,
    /// Change of the relative rotation between the middle rows and the first or last rows, the larger of both.
    pub sweep: Angle,
}

/// Computes the pose at the middle rows of a pair, and its change over the other rows.
///
/// # Errors
/// [`TrackGap`] where the encoder readings do not cover an exposure.
pub fn middle_pose(rig: &Rig, joints: &impl Joints, exposure: &PairExposure) -> Result<MiddlePose, TrackGap> {
    let at = |rows: [f64; 2]| {
        let left = joints.at(exposure.left.at_row(rows[0]))?;
        Ok(rig.pose_of_each(&left, &joints.at(exposure.right.at_row(rows[1]))?))
    };
    let last = [exposure.left.rows, exposure.right.rows].map(|rows| f64::from(rows) - 1.0);
    let pose = at(last.map(|row| 0.5 * row))?;
    let turned = |other: RigPose| pose.left_from_right.rotation().angle_to(&other.left_from_right.rotation());
    let sweep = turned(at([0.0, 0.0])?).max(turned(at(last)?));
    Ok(MiddlePose { pose, sweep: Angle::from_rad(sweep) })
}

/// Triangulates matches of two moving cameras, each with the poses of both cameras at the exposure of its own rows.
///
/// Each match comes with the standard deviations of its positions in pixels (one number, or [`MatchSigma`]). Points are in the frame of the left camera
/// at its middle row. The shared covariance in `gates` is replaced by that of each point's own pose, which grows
/// with the speed of the stages and the uncertainty of the exposure's instant.
///
/// # Errors
/// [`TrackGap`] where the encoder readings do not cover an exposure.
pub fn moving_cloud<S: Copy + Into<MatchSigma>>(
    pairs: &[(PixelPair, S)],
    rig: &Rig,
    joints: &impl Joints,
    exposure: &PairExposure,
    gates: &Gates,
) -> Result<Cloud, TrackGap> {
    let reference_from_base = rig.pose(&joints.at(exposure.left.middle)?).base_from_left.inverse();
    let calibration = rig.calibration_at(&joints.at(exposure.left.middle)?, &joints.at(exposure.right.middle)?);
    let (mut cloud, mut of_rows) = (Cloud::default(), None::<OfRows>);
    for (pair_index, (pixels, sigma)) in pairs.iter().enumerate() {
        let at = [joints.at(exposure.left.at_row(pixels.left.v))?, joints.at(exposure.right.at_row(pixels.right.v))?];
        // While the axes stand, one pose is that of all rows.
        if of_rows.as_ref().is_none_or(|last| last.joints != at) {
            of_rows = Some(OfRows::new(at, rig, &calibration, gates));
        }
        let Some(OfRows { pose, gates, .. }) = &of_rows else { continue };
        match point((pixels, (*sigma).into()), rig, &reference_from_base, pose, gates) {
            Ok(point) => cloud.points.push(CloudPoint { pair_index, ..point }),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    Ok(cloud)
}

/// The pose at the exposure of a row of each image, and the gates of a point there.
struct OfRows {
    joints: [JointsAt; 2],
    pose: RigPose,
    gates: Gates,
}

impl OfRows {
    fn new(joints: [JointsAt; 2], rig: &Rig, calibration: &SharedCovariance, gates: &Gates) -> Self {
        let pose = rig.pose_of_rows(&joints[0], &joints[1], calibration);
        Self { gates: Gates { shared: pose.shared, ..*gates }, joints, pose }
    }
}

fn point(
    (pixels, sigma): (&PixelPair, MatchSigma),
    rig: &Rig,
    reference_from_base: &Transform<Left, Base>,
    pose: &RigPose,
    gates: &Gates,
) -> Result<CloudPoint, DropReason> {
    let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
    let point = cloud_point(pixels, sigma, &pair, gates)?;
    let reference_from_left: Transform<Left, Left> = *reference_from_base * pose.base_from_left;
    let turn = reference_from_left.rotation().to_rotation_matrix();
    Ok(CloudPoint {
        point: reference_from_left * point.point,
        covariance: turn * point.covariance * turn.transpose(),
        own_covariance: turn * point.own_covariance * turn.transpose(),
        ..point
    })
}
