//! Compares a calibration of a simulated stage with the mechanism as it was really built.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vergence_calibration::StageCalibration;
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Angle, Length};

/// Number of random poses at which both are compared.
const POSES: usize = 30;

/// Difference between the predicted and the true relative pose, rms over random poses in the range of the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueError {
    /// Number of poses.
    pub poses: usize,
    /// Of the rotation of the right camera.
    pub rotation: Angle,
    /// Of the position of the right camera.
    pub translation: Length,
}

impl std::fmt::Display for TrueError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { poses, rotation, translation } = self;
        let (turn, shift) = (rotation.deg(), translation.mm());
        write!(f, "against the simulated truth at {poses} unseen poses: {turn:.4}° and {shift:.4} mm rms")
    }
}

impl TrueError {
    /// The difference for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let Self { poses, rotation, translation } = self;
        json!({ "poses": poses, "rotation_rms_deg": rotation.deg(), "translation_rms_mm": translation.mm() })
    }

    /// Compares `stage` with the rig as it was really `built`, at poses drawn with `seed`. The truth is used for this score
    /// alone.
    #[must_use]
    pub fn of(stage: &StageCalibration, built: &Rig, seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let (mut rotation, mut translation) = (0.0, 0.0);
        for _ in 0..POSES {
            let values: Vec<f64> = built
                .axes
                .iter()
                .map(|axis| {
                    let [low, high] = axis.range.map(AxisPosition::value);
                    random.random_range(low..high)
                })
                .collect();
            let readings: Vec<AxisPosition> = built
                .axes
                .iter()
                .zip(&values)
                .map(|(axis, &value)| AxisPosition::from_value(axis.kind, value))
                .collect();
            let (found, truth) =
                (stage.predict(&readings).left_from_right, built.pose_at_values(&values).left_from_right);
            rotation += found.rotation().angle_to(&truth.rotation()).powi(2);
            translation += (found.origin().mm() - truth.origin().mm()).norm_squared();
        }
        let rms = |squares: f64| (squares / POSES as f64).sqrt();
        Self { poses: POSES, rotation: Angle::from_rad(rms(rotation)), translation: Length::from_mm(rms(translation)) }
    }
}
