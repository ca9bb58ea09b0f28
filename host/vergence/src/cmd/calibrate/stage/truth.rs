//! Compares a calibration of a simulated stage with the mechanism as it was really built.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vergence_calibration::StageCalibration;
use vergence_rig::{AxisPosition, Rig};

use crate::console::Console;
use crate::failure::Failure;

/// Number of random poses at which both are compared.
const POSES: usize = 30;

/// Difference between the predicted and the true relative pose, rms over random poses in the range of the axes. The truth is
/// used for this score alone.
///
/// # Errors
/// Where standard output cannot be written.
pub fn compare(stage: &StageCalibration, built: &Rig, seed: u64, console: Console) -> Result<Value, Failure> {
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
        let readings: Vec<AxisPosition> =
            built.axes.iter().zip(&values).map(|(axis, &value)| AxisPosition::from_value(axis.kind, value)).collect();
        let (found, truth) = (stage.predict(&readings).left_from_right, built.pose_at_values(&values).left_from_right);
        rotation += found.rotation().angle_to(&truth.rotation()).powi(2);
        translation += (found.origin().mm() - truth.origin().mm()).norm_squared();
    }
    let rms = |squares: f64| (squares / POSES as f64).sqrt();
    let (rotation_deg, translation_mm) = (rms(rotation).to_degrees(), rms(translation));
    console.say(format!(
        "against the simulated truth at {POSES} unseen poses: {rotation_deg:.4}° and {translation_mm:.4} mm rms"
    ))?;
    Ok(json!({ "poses": POSES, "rotation_rms_deg": rotation_deg, "translation_rms_mm": translation_mm }))
}
