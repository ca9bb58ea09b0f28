//! The folding trunk: zeros of its joints, lengths of its links and mounts of its cameras, from targets seen at several shapes.
//!
//! Two cameras tell their relative pose and nothing of where the base is. So the mount of the left camera trades with the zero of the
//! front corner, all folds' zeros with the mounts' rolls unless the trunk folds, and the drawing's tolerances decide. The result says
//! of every number how much of it the images told.

mod holdout;
mod model;
mod play;
mod result;

use vergence_rig::{Rig, RigTrunk};

use crate::extrinsics::{Start, Task};
use crate::stage::start::{check_readings, poses_alone, prepare};
use crate::stage::{FEWEST_STAGE_POSES, StageError, StageOptions, StagePose};
use crate::trunk::model::Model;

pub use holdout::validate_trunk;
pub use play::PlayFound;
pub(crate) use result::play_of;
pub use result::{TrunkCalibration, TrunkParameterFigures, TrunkPoseFigures, largest_trunk_sigma};

/// Calibrates the trunk of `rig` on targets seen at `poses`. Of the options, those of lenses and outliers count; tolerances and play
/// are those of the rig.
///
/// # Errors
/// [`StageError`] if stage poses are too few, cannot be calibrated, do not fit the trunk, or the rig has none.
pub fn calibrate_trunk(rig: &Rig, poses: &[StagePose], options: &StageOptions) -> Result<TrunkCalibration, StageError> {
    let trunk = rig.trunk.as_deref().ok_or_else(|| StageError::NoTrunk(rig.name.clone()))?;
    if poses.len() < FEWEST_STAGE_POSES {
        return Err(StageError::TooFewPoses(poses.len()));
    }
    check_readings(rig, poses)?;
    let mut model = model(rig, trunk, poses);
    if model.reading_sigma.iter().flatten().any(|&sigma| sigma <= 0.0) {
        return Err(StageError::ReadingSigma);
    }
    let alone = poses_alone(rig, poses, options.robust)?;
    let (state, play) = play::fitted_to_poses(&mut model, &alone).ok_or(StageError::Diverged)?;
    let prepared = prepare(rig, state, poses, model::State::left_from_right)?;
    let model = Model { pose_of_view: prepared.pose_of_view, ..model };
    let task = Task {
        kinematics: &model,
        views: &prepared.views,
        own_poses: &prepared.own_poses,
        lenses: prepared.shared.lenses,
        knowledge: &options.lenses,
        robust: options.robust,
    };
    let fit = task
        .fit(Start { shared: prepared.shared, targets: prepared.targets, usable: prepared.usable.clone() })
        .map_err(|reason| StageError::Joint(reason.into()))?;
    result::calibration(&result::Material {
        rig,
        poses,
        model: &model,
        fit: &fit,
        play,
        alone: &alone,
        views: &prepared.views,
        usable: &prepared.usable,
    })
}

/// The model of the trunk at the stage poses, as the rig file has it.
fn model(rig: &Rig, trunk: &RigTrunk, poses: &[StagePose]) -> Model {
    let values = |pose: &StagePose| -> Vec<f64> { pose.readings.iter().map(|reading| reading.value()).collect() };
    Model {
        drawn: trunk.parameters().to_array(),
        tolerance: trunk.tolerance,
        readings: poses.iter().map(|pose| trunk.driven(&values(pose))).collect(),
        reading_sigma: vec![std::array::from_fn(|joint| trunk.reading_sigma(joint, &rig.axes)); poses.len()],
        start: poses.iter().map(|pose| trunk.angles(&values(pose))).collect(),
        // While the stage poses are fitted as such, the views of the mechanism are they.
        pose_of_view: (0..poses.len()).collect(),
    }
}
