//! Stage poses that too few views show.

use vergence_rig::Rig;

use crate::extrinsics::{ExtrinsicsError, FEWEST_VIEWS, place};
use crate::stage::{FEWEST_STAGE_POSES, StagePose};

/// Leaves out stage poses whose views are too few to calibrate them by themselves; returns the others, and those left out, counted from 1, with the reason.
///
/// Where fewer than [`FEWEST_STAGE_POSES`] would remain all of them do, and the calibration says what is missing.
#[must_use]
pub fn with_enough_views(rig: &Rig, poses: Vec<StagePose>) -> (Vec<StagePose>, Vec<(usize, ExtrinsicsError)>) {
    let too_few = |pose: &StagePose| {
        // What else is wrong with a view the calibration says.
        let (placed, _) = place(&rig.left_camera, &rig.right_camera, &pose.views).ok()?;
        (placed.len() < FEWEST_VIEWS).then_some(ExtrinsicsError::TooFewViews { usable: placed.len() })
    };
    let reasons: Vec<Option<ExtrinsicsError>> = poses.iter().map(too_few).collect();
    if reasons.iter().filter(|reason| reason.is_none()).count() < FEWEST_STAGE_POSES {
        return (poses, Vec::new());
    }
    let (mut kept, mut left_out) = (Vec::new(), Vec::new());
    for (index, (pose, reason)) in poses.into_iter().zip(reasons).enumerate() {
        match reason {
            Some(reason) => left_out.push((index + 1, reason)),
            None => kept.push(pose),
        }
    }
    (kept, left_out)
}
