//! The limits of the gates (`vergence_vision::Gates`) that all verbs share, in one place.

use nalgebra::Matrix6;
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Angle, Gates, Kernel, Length};

/// Default standard deviation of a pixel position, in pixels.
pub const PIXEL_SIGMA: f64 = 0.2;
/// Standard deviation of the position of a corner in a single image, in pixels: no second image has registered it.
pub const CORNER_SIGMA: f64 = 0.5;
/// Width of the gates, in standard deviations.
pub const GATE_SIGMAS: f64 = 3.0;
/// Smallest rotation error that the matcher allows for, so that a pose which is off can be noticed.
pub const LEAST_MATCHING_SIGMA: Angle = Angle::from_deg(0.15);
/// Standard deviation of the relative rotation by the joints alone above which the images are asked for the pose as well: a calibrated bench tells it to
/// some 0.02 degrees, and the matches of one pair to 0.02 to 0.1.
pub const JOINTS_SUFFICE: Angle = Angle::from_deg(0.15);
/// How far rays may be out of their epipolar plane, as a standard deviation, where nothing is known of the calibration: that of a
/// well calibrated bench. It widens the gate, and is no part of the uncertainty that outputs state.
pub const ASSUMED_MISALIGNMENT: Angle = Angle::from_deg(0.05);
/// The same of the right camera's place, along each axis.
const ASSUMED_SHIFT: Length = Length::from_mm(0.1);
/// Largest standard deviation of a point's range from its own two pixels, as a part of the range.
pub const MAX_RELATIVE_SIGMA: f64 = 0.05;

/// An axis whose reading differs by more counts than this has moved.
pub const FLICKER_COUNTS: f64 = 2.0;

/// The gates for clouds of `rig` in `pose`, with points up to the range `farthest`: as wide as pixels and pose are uncertain.
#[must_use]
pub fn cloud_gates(rig: &Rig, pose: &RigPose, kernel: Kernel, farthest: Option<Length>) -> Gates {
    let pixel = PIXEL_SIGMA / rig.left_camera.pixels_per_radian(Angle::from_rad(0.0));
    Gates {
        epipolar_sigmas: GATE_SIGMAS,
        min_parallax: Angle::from_rad(GATE_SIGMAS * std::f64::consts::SQRT_2 * pixel),
        max_range: farthest,
        pixel_sigma: PIXEL_SIGMA,
        max_relative_sigma: MAX_RELATIVE_SIGMA,
        shared: pose.shared,
        epipolar_allowance: if pose.is_calibration_known { Angle::from_rad(0.0) } else { ASSUMED_MISALIGNMENT },
        kernel,
    }
}

/// The covariance of the relative pose against which matches are tested for a drift.
pub(crate) fn expected_drift(pose: &RigPose) -> Matrix6<f64> {
    let known = pose.covariance();
    if pose.is_calibration_known {
        return known;
    }
    let (turn, shift) = (ASSUMED_MISALIGNMENT.rad().powi(2), ASSUMED_SHIFT.mm().powi(2));
    known + Matrix6::from_diagonal(&[turn, turn, turn, shift, shift, shift].into())
}

/// The standard deviation of the relative rotation that the matcher allows for. `sweep` is how far the pose turns while the
/// images are exposed.
#[must_use]
pub fn matching_sigma(pose: &RigPose, sweep: Angle) -> Angle {
    Angle::from_rad(pose.rotation_sigma.rad().hypot(sweep.rad()).max(LEAST_MATCHING_SIGMA.rad()))
}
