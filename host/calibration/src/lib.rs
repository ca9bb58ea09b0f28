//! Calibration without an initial guess: lens intrinsics, pair extrinsics, the moving stage, and the covariance of each.
//!
//! Everything is a pure function of its arguments: corners in, calibrations with covariance out.

mod arun;
mod coverage;
mod extrinsics;
mod fit_check;
mod intrinsics;
mod lens_difference;
mod planar_pose;
mod reprojection;
mod robust;
pub mod schur_lm;
mod stage;
mod stage_plan;
mod target_shape;
mod trunk;
mod uncertainty;
mod validation;

pub use arun::{ArunError, fit_rotation_translation};
pub use coverage::{Advice, Coverage};
pub use extrinsics::{
    ExtrinsicsCalibration, ExtrinsicsError, ExtrinsicsOptions, FEWEST_VIEWS, LabelError, LensKnowledge, RelativePose,
    Side, SkippedView, StereoOutlier, StereoOutlierReason, StereoView, StereoViewFigures, calibrate_extrinsics,
    label_pairs,
};
pub use fit_check::{Unfit, check_fit};
pub use intrinsics::{
    IntrinsicsCalibration, IntrinsicsError, IntrinsicsOptions, LensModel, LensParameters, LensStep, Outlier,
    OutlierReason, Parameter, PupilEvidence, Reprojection, StepEvidence, StepVerdict, UnknownLensModel, ViewFigures,
    ViewPose, calibrate_intrinsics, refine_intrinsics, reproject,
};
pub use lens_difference::{LensDifference, LensDifferenceError};
pub use planar_pose::{PoseError, TargetPose, target_pose, target_pose_of};
pub use robust::Loss;
pub use stage::{
    EncoderScale, FEWEST_STAGE_POSES, FittedScrew, Observability, PredictedPose, StageCalibration, StageError,
    StageOptions, StagePose, StagePoseFigures, Tolerance, WeakDirection, ZeroOffset, calibrate_stage,
    with_enough_views,
};
pub use stage_plan::stage_plan;
pub use target_shape::{TargetShape, TargetWarp};
pub use trunk::{
    PlayFound, TrunkCalibration, TrunkParameterFigures, TrunkPoseFigures, calibrate_trunk, largest_trunk_sigma,
    validate_trunk,
};
pub use uncertainty::{MapPoint, RayCovariance, RayUncertainty};
pub use validation::{HeldOutPose, HeldOutView, Validation, validate_extrinsics, validate_intrinsics, validate_stage};
