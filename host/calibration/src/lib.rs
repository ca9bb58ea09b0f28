//! Calibration that needs no luck: boards, intrinsics, extrinsics, the moving stage, and how sure each of them is.
//!
//! Everything is a pure function of its arguments; images and corners come in, calibrations with covariance go out.

pub mod arrow;
mod arun;
mod board;
mod coverage;
pub mod detect;
mod extrinsics;
mod intrinsics;
mod planar_pose;
mod report;
mod reprojection;
mod robust;
mod stage;
mod uncertainty;
mod validation;

pub use arun::{ArunError, fit_rotation_translation};
pub use board::{Board, BoardSpec, BoardView, Corner};
pub use coverage::{Advice, Coverage};
pub use extrinsics::{
    ExtrinsicsCalibration, ExtrinsicsError, ExtrinsicsOptions, FEWEST_VIEWS, LensKnowledge, RelativePose, Side,
    SkippedView, StereoOutlier, StereoOutlierReason, StereoView, StereoViewFigures, calibrate_extrinsics,
};
pub use intrinsics::{
    BoardWarp, IntrinsicsCalibration, IntrinsicsError, IntrinsicsOptions, Outlier, OutlierReason, Parameter,
    Reprojection, ViewFigures, ViewPose, calibrate_intrinsics, refine_intrinsics, reproject,
};
pub use planar_pose::{BoardPose, PoseError, board_pose};
pub use report::{
    ReportAbout, Verdict, extrinsics_report, extrinsics_verdict, intrinsics_report, intrinsics_verdict, stage_report,
    stage_verdict,
};
pub use robust::{Loss, median};
pub use stage::{
    EncoderScale, FEWEST_STAGE_POSES, FittedScrew, Observability, PredictedPose, StageCalibration, StageError,
    StageOptions, StagePose, StagePoseFigures, Tolerance, WeakDirection, ZeroOffset, calibrate_stage,
};
pub use uncertainty::{MapPoint, RayCovariance, RayUncertainty};
pub use validation::{HeldOutPose, HeldOutView, Validation, validate_extrinsics, validate_intrinsics, validate_stage};
