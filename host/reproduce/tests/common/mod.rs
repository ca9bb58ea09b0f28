//! Helpers of several tests: lenses, rigs, projections of points, and Gaussian numbers.

#![allow(dead_code, reason = "every test uses a part")]
#![allow(unused_imports, reason = "every test uses a part")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod robot;

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use vergence_alignment::pose_difference;
use vergence_reproduce::study;
use vergence_vision::{Angle, Base, KannalaBrandt, Left, Length, Right, Transform};

pub use robot::Robot;
pub use vergence_reproduce::study::{Gaussian, see};

pub fn lens(k1: f64) -> KannalaBrandt {
    study::lens(k1).unwrap()
}

pub fn left_from_right(separation_deg: f64) -> Transform<Left, Right> {
    study::left_from_right(Angle::from_deg(separation_deg))
}

pub fn left_from_middle(separation_deg: f64) -> Transform<Left, Base> {
    study::left_from_middle(Angle::from_deg(separation_deg))
}

/// Baseline in millimetres and separation in degrees.
pub fn around(range: f64, azimuth: f64, elevation: f64) -> Vector3<f64> {
    study::around(Length::from_mm(range), Angle::from_deg(azimuth), Angle::from_deg(elevation))
}

/// The way from a stated pose to the true one, a turn in radians and a shift in millimetres, where the frames of the left and the right camera's rays
/// are known turned so against the true ones.
pub fn way_to_truth(
    stated: &Transform<Left, Right>,
    truth: &Transform<Left, Right>,
    [left, right]: [UnitQuaternion<f64>; 2],
) -> Vector6<f64> {
    let (left, right) = (Transform::new(left, Vector3::zeros()), Transform::new(right, Vector3::zeros()));
    pose_difference(&(left * *truth * right.inverse()), stated)
}

/// The number of samples from the environment, for long runs.
pub fn count(variable: &str, otherwise: u32) -> u32 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}
