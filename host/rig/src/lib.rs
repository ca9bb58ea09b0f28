//! The rig: its description, its kinematics, and where its cameras were at an exposure.
//!
//! A [`Rig`] is read from TOML. Its axes turn encoder counts into positions, a screw chain per camera turns positions into
//! `base_from_left` and `base_from_right`, a [`ClockMap`] brings the host's instants onto the board's clock, and a
//! [`JointTrack`] tells the counts at that instant. Together they give a [`RigPose`], or one for every row of the images
//! ([`moving_cloud`]). A [`DepthField`] tells how well a pose will measure, before anything moves.
//!
//! Everything is a pure function of its arguments: no file is read here.

mod axis;
mod best_pose;
mod camera_file;
mod chain;
mod clock;
mod depth_field;
mod file;
mod frame_pairing;
mod goal;
mod interchange;
mod moving;
mod pose;
mod rig;
mod text;
mod to_toml;
mod track;

pub use axis::{AxisPosition, RigAxis};
pub use best_pose::RatedPose;
pub use camera_file::{CalibrationTable, CameraDocument, CameraTable, Provenance};
pub use chain::{Chain, Link, Screw};
pub use clock::{BoardInstant, ClockDrift, ClockMap, Exchange, HostInstant};
pub use depth_field::{DepthField, PredictedDepth};
pub use file::RigError;
pub use frame_pairing::{ExposureDelay, Fate, FramePairing, StampedFrame, TimedEvent};
pub use goal::{DepthGoal, DepthSigma, InvalidGoal};
pub use interchange::{Camchain, CameraFormat, InterchangeError, kalibr, opencv};
pub use moving::{Exposure, MiddlePose, PairExposure, Shutter, middle_pose, moving_cloud};
pub use pose::RigPose;
pub use rig::{Mode, Rig};
pub use track::{JointSample, JointTrack, Joints, JointsAt, SteadyMotion, TrackGap};

/// The built-in bench, as the TOML file a user would write.
pub const BENCH_TOML: &str = include_str!("bench.toml");
