//! What the matches of a pair say of its relative pose and of its lenses, by the angles of their rays to the epipolar planes.
//!
//! - [`pose_drift`] tests the stated pose against the matches, and [`fuse_pose`] takes it from both;
//! - [`lens_growth`] tests whether the lenses are as long as at their calibration.

mod lens_growth;
mod pose_drift;
mod pose_equation;
mod pose_fusion;
mod residual_spread;

pub use lens_growth::{LensGrowth, lens_growth};
pub use pose_drift::{PoseDrift, pose_drift};
pub use pose_equation::{difference as pose_difference, moved as moved_pose};
pub use pose_fusion::{FusedPose, MatchErrors, fuse_pose};
