//! The rig: its description, its kinematics, and the pose of its cameras at an exposure.
//!
//! A [`Rig`] is read from TOML ([`Rig::from_toml`]). Its axes convert encoder counts to positions, a screw chain per
//! camera, or a closed loop of links ([`linkage`]), converts positions to `base_from_left` and `base_from_right`, a [`ClockMap`] converts the host's instants to
//! the board's clock, and a [`JointTrack`] interpolates the counts at that instant. Together they give a [`RigPose`],
//! or one for every row of the images ([`moving_cloud`]). A [`DepthField`] predicts how well a pose will measure,
//! before anything moves, and a [`ModePolicy`] chooses a mode by such predictions.
//!
//! Everything is a pure function of its arguments: no file is read here.

mod axis;
mod best_pose;
mod calibration;
mod camera_file;
mod chain;
mod clock;
mod depth_field;
mod exposure;
mod exposure_timing;
mod file;
mod goal;
mod image_pairing;
mod in_json;
mod lens_field;
pub mod linkage;
mod mask;
mod mode;
mod mode_policy;
mod moving;
mod pitch;
mod pose;
mod repeatability;
mod rig;
mod text;
mod to_toml;
mod track;
mod trunk;

pub use axis::{AxisPosition, RigAxis, positions_in_words};
pub use best_pose::RatedPose;
pub use calibration::{
    CalibratedNumbers, InvalidCovariance, RigCalibration, RigNumber, UnknownLensErrors, common_turn_by_lens,
    even_directions,
};
pub use camera_file::{CalibrationTable, CameraDocument, CameraTable, Provenance};
pub use chain::{Chain, Link, Screw};
pub use clock::{BoardInstant, ClockDrift, ClockMap, Exchange, HostInstant};
pub use depth_field::{DepthField, PredictedDepth};
pub use exposure::{Exposure, PairExposure, Shutter};
pub use exposure_timing::{ExposureTiming, MiddleOfExposure, SequenceWatch, StampedAt};
pub use file::RigError;
pub use goal::{DepthGoal, DepthSigma, InvalidGoal};
pub use image_pairing::{ExposureDelay, ImagePairing, PairingOutcome, StampedImage, TimedEvent};
pub use in_json::{axes_json, camera_in_words, camera_json, closure_in_words, closure_json, rounded, zones_json};
pub use lens_field::{LensField, UnknownField};
pub use mask::{CameraMask, MaskError, MaskShape, mask_of, mask_of_shapes};
pub use mode::{Mode, ReportedMode};
pub use mode_policy::{ModeChoice, ModeFigures, ModePolicy, PolicyRule, TargetBelief, Task, TaskState};
pub use moving::{MiddlePose, middle_pose, moving_cloud};
pub use pitch::{PitchTable, PitchTableError};
pub use pose::RigPose;
pub use repeatability::Repeatability;
pub use rig::Rig;
pub use track::{JointSample, JointTrack, Joints, JointsAt, SteadyMotion, TrackGap};
pub use trunk::{
    OpenLoop, RigTrunk, TRUNK_AXES, TRUNK_PARAMETER_NAMES, TRUNK_PARAMETERS, TrunkClosure, TrunkCovariance,
    TrunkParameterKind, TrunkParameters, TrunkTolerance,
};

/// The rig file of the built-in bench, as a user would write it.
pub const BENCH_TOML: &str = include_str!("bench.toml");
