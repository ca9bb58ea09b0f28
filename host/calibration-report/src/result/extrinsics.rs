//! The result of the calibration of a pair as a rig, as lines of text and as JSON.

use nalgebra::Matrix6;
use serde_json::{Value, json};
use vergence_calibration::{ExtrinsicsCalibration, RelativePose};
use vergence_rig::{Rig, RigCalibration};

use super::intrinsics::{bow_in_words, bow_json};

/// The rig file's pair, called `name`, of a calibration; its covariance covers the scatter of the views.
#[must_use]
pub fn fixed_pair(calibration: &ExtrinsicsCalibration, name: &str) -> Rig {
    let lenses = (calibration.left, calibration.right);
    let pair = Rig::fixed_pair(name, lenses, calibration.joint.left_from_right);
    // A covariance of the solver is one: only rounding could refuse it, and then nothing is known.
    Rig { calibration: calibration.numbers().map_or(RigCalibration::Unknown, RigCalibration::Covariance), ..pair }
}

/// Of the rotation in radians about the left axes, and of the position in millimetres.
fn sigma(covariance: &Matrix6<f64>) -> [f64; 6] {
    std::array::from_fn(|index| covariance[(index, index)].max(0.0).sqrt())
}

/// The result of the calibration of a pair as lines for people.
#[must_use]
pub fn extrinsics_lines(calibration: &ExtrinsicsCalibration) -> Vec<String> {
    let line = |name: &str, pose: &RelativePose| {
        let (origin, turn) = (pose.left_from_right.origin().mm(), pose.left_from_right.rotation());
        format!(
            "{name}: baseline {:.3} mm, rotation {:.4}°, {:.3} px rms",
            origin.norm(),
            turn.angle().to_degrees(),
            pose.rms_px
        )
    };
    let mut lines = vec![line("each camera alone", &calibration.arun), line("joint            ", &calibration.joint)];
    let sigma = sigma(&calibration.covariance);
    let degrees: Vec<_> = sigma[..3].iter().map(|rad| format!("{:.4}", rad.to_degrees())).collect();
    let mm: Vec<_> = sigma[3..].iter().map(|mm| format!("{mm:.3}")).collect();
    lines.push(format!("  sigma: rotation {} °, position {} mm", degrees.join(" "), mm.join(" ")));
    lines.push(format!(
        "  {} of {} corners, {:.3} px rms without the outliers",
        calibration.corners_inlier, calibration.corners_total, calibration.rms_inlier_px
    ));
    lines.extend(calibration.warp.map(|warp| format!("  {}", bow_in_words(&warp))));
    for outlier in &calibration.outliers {
        lines.push(format!(
            "  left out: {} camera, {}, corner at {:?} mm, {:.2} px off: {}",
            outlier.side, outlier.view, outlier.target_mm, outlier.error_px, outlier.reason
        ));
    }
    for skipped in &calibration.skipped {
        lines.push(format!("  view not used: {} ({} camera: {})", skipped.view, skipped.side, skipped.reason));
    }
    lines
}

/// The result of the calibration of a pair for programs; `seconds` is how long it took.
#[must_use]
pub fn extrinsics_json(calibration: &ExtrinsicsCalibration, seconds: f64) -> Value {
    let pose = |pose: &RelativePose| {
        json!({
            "baseline_mm": pose.left_from_right.origin().mm().norm(),
            "rotation_deg": pose.left_from_right.rotation().angle().to_degrees(),
            "rms_px": pose.rms_px,
        })
    };
    let mut joint = pose(&calibration.joint);
    let turn = calibration.joint.left_from_right.rotation().scaled_axis();
    joint["rms_inlier_px"] = json!(calibration.rms_inlier_px);
    joint["translation_mm"] = json!(calibration.joint.left_from_right.origin().mm().as_slice());
    joint["rotation_vector"] = json!(turn.as_slice());
    joint["sigma"] = json!(sigma(&calibration.covariance));
    joint["view_scatter"] = json!(calibration.view_scatter);
    // The vectors above are left_from_right; others, OpenCV among them, write the way back.
    let back = calibration.joint.left_from_right.inverse();
    joint["right_from_left"] = json!({
        "translation_mm": back.origin().mm().as_slice(),
        "rotation_vector": back.rotation().scaled_axis().as_slice(),
    });
    json!({
        "arun": pose(&calibration.arun),
        "joint": joint,
        "corners_total": calibration.corners_total,
        "corners_inlier": calibration.corners_inlier,
        "views_used": calibration.views.len(),
        "target_bow": bow_json(calibration.warp),
        "seconds": seconds,
    })
}
