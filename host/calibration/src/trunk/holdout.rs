//! Cross-validation of a trunk's calibration: each stage pose is predicted by the others.

use rayon::prelude::*;
use vergence_rig::Rig;
use vergence_vision::{Angle, Length};

use crate::reprojection::difference;
use crate::trunk::calibrate_trunk;
use crate::{
    ExtrinsicsOptions, FEWEST_STAGE_POSES, HeldOutPose, StageError, StageOptions, StagePose, calibrate_extrinsics,
};

/// Leaves out one stage pose after the other. What is predicted is the pose by the joints alone, play included: near a dead centre
/// it is uncertain by degrees.
///
/// # Errors
/// [`StageError`] where the stage poses that are left do not give a calibration.
pub fn validate_trunk(rig: &Rig, poses: &[StagePose], options: &StageOptions) -> Result<Vec<HeldOutPose>, StageError> {
    if poses.len() <= FEWEST_STAGE_POSES {
        return Err(StageError::TooFewPoses(poses.len().saturating_sub(1)));
    }
    let without = |(index, held): (usize, &StagePose)| {
        let kept: Vec<StagePose> =
            poses.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, pose)| pose.clone()).collect();
        let calibration = calibrate_trunk(rig, &kept, options)?;
        let own = ExtrinsicsOptions { robust: options.robust, ..ExtrinsicsOptions::default() };
        let alone = calibrate_extrinsics(&calibration.left, &calibration.right, &held.views, &own)
            .map_err(|reason| StageError::Pose { pose: index + 1, reason })?;
        let predicted = calibration.rig(rig).pose_read_at(&calibration.values(rig, &held.readings));
        let off = difference(predicted.left_from_right.isometry(), alone.joint.left_from_right.isometry());
        let weighed = (predicted.covariance() + alone.covariance).cholesky().map(|factor| factor.solve(&off));
        Ok(HeldOutPose {
            readings: held.readings.clone(),
            rotation: Angle::from_rad(off.fixed_rows::<3>(0).norm()),
            translation: Length::from_mm(off.fixed_rows::<3>(3).norm()),
            chi_square: weighed.map_or(f64::INFINITY, |weighed| off.dot(&weighed)),
        })
    };
    poses.par_iter().enumerate().map(without).collect()
}
