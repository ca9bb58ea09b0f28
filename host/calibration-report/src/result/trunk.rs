//! The result of a trunk's calibration as lines of text and as JSON.

use serde_json::{Value, json};
use vergence_calibration::{HeldOutPose, PlayFound, TrunkCalibration, TrunkParameterFigures, largest_trunk_sigma};
use vergence_rig::{AxisPosition, Rig, RigAxis, positions_in_words};

/// A number of the trunk with its unit and standard deviation, such as "140.213 mm +- 0.031".
pub(crate) fn in_unit(figures: &TrunkParameterFigures, value: f64) -> f64 {
    if figures.kind.is_angle() { value.to_degrees() } else { value }
}

/// The unit of a number of the trunk.
pub(crate) fn unit(figures: &TrunkParameterFigures) -> &'static str {
    if figures.kind.is_angle() { "°" } else { "mm" }
}

/// What the stage poses told of the play of the corners or of the folds.
pub(crate) fn play_in_words(found: &PlayFound) -> String {
    if !found.is_told() {
        format!("as the rig file states; {:.0} readings to spare do not tell", found.redundancy)
    } else {
        format!("{:.2} of what the rig file stated, from {:.0} readings to spare", found.factor, found.redundancy)
    }
}

/// The result of a trunk's calibration as lines for people; `held_out` are the stage poses that were left out in turn.
#[must_use]
pub fn trunk_lines(trunk: &TrunkCalibration, held_out: &[HeldOutPose]) -> Vec<String> {
    let mut lines = vec![format!(
        "{} stage poses, {} of {} corners: {:.3} px rms ({:.3} px with the outliers)",
        trunk.poses.len(),
        trunk.corners_inlier,
        trunk.corners_total,
        trunk.rms_inlier_px,
        trunk.rms_px
    )];
    for pose in &trunk.poses {
        let worst = pose.reading_errors.iter().map(|error| error.deg().abs()).fold(0.0, f64::max);
        lines.push(format!(
            "  at {}: {:.3} px rms; joints off by {worst:.3}° at most{}; {:.4}° and {:.3} mm from the pose of its own views",
            positions_in_words(&pose.readings),
            pose.rms_inlier_px,
            if pose.is_strained { " (strained: more than play explains)" } else { "" },
            pose.rotation_difference.deg(),
            pose.translation_difference.mm()
        ));
    }
    for figures in &trunk.parameters {
        let [value, sigma, drawn] = [figures.value, figures.sigma, figures.drawn].map(|value| in_unit(figures, value));
        lines.push(format!(
            "  {}: {value:.3} ± {sigma:.3} {} (drawn {drawn:.3}); {:.0} % from the images",
            figures.name,
            unit(figures),
            100.0 * figures.from_images()
        ));
    }
    for (joints, found) in ["corners", "folds"].into_iter().zip(&trunk.play) {
        lines.push(format!("  play of the {joints}: {}", play_in_words(found)));
    }
    for skipped in &trunk.skipped {
        lines.push(format!("  view not used: {} ({} camera: {})", skipped.view, skipped.side, skipped.reason));
    }
    for pose in held_out {
        let readings = positions_in_words(&pose.readings);
        let (turn, shift) = (pose.rotation.deg(), pose.translation.mm());
        lines.push(format!("  without the pose at {readings} it is predicted to {turn:.4}° and {shift:.3} mm"));
    }
    lines
}

/// The result of a trunk's calibration, which made `rig`, for programs; `held_out` are the stage poses that were left out in turn.
#[must_use]
pub fn trunk_json(rig: &Rig, trunk: &TrunkCalibration, held_out: &[HeldOutPose]) -> Value {
    let readings = |positions: &[AxisPosition]| -> Value {
        let entries = rig.axes.iter().zip(positions).map(|(axis, &at)| (RigAxis::column(axis), json!(at.mm_or_deg())));
        Value::Object(entries.collect())
    };
    let poses = trunk.poses.iter().map(|pose| {
        let errors: Vec<f64> = pose.reading_errors.iter().map(|error| error.deg()).collect();
        json!({
            "readings": readings(&pose.readings),
            "rms_inlier_px": pose.rms_inlier_px,
            "reading_errors_deg": errors,
            "strained": pose.is_strained,
            "rotation_difference_deg": pose.rotation_difference.deg(),
            "translation_difference_mm": pose.translation_difference.mm(),
        })
    });
    let parameters = trunk.parameters.iter().map(|figures| {
        let [value, sigma, drawn, tolerance] =
            [figures.value, figures.sigma, figures.drawn, figures.tolerance].map(|value| in_unit(figures, value));
        json!({
            "name": figures.name, "unit": if figures.kind.is_angle() { "deg" } else { "mm" },
            "value": value, "sigma": sigma, "drawn": drawn, "tolerance": tolerance, "from_images": figures.from_images(),
        })
    });
    let play = ["corners", "folds"]
        .into_iter()
        .zip(&trunk.play)
        .map(|(joints, found)| json!({ "joints": joints, "factor": found.factor, "redundancy": found.redundancy }));
    let held_out = held_out.iter().map(|pose| {
        json!({
            "readings": readings(&pose.readings), "rotation_deg": pose.rotation.deg(),
            "translation_mm": pose.translation.mm(), "chi_square": pose.chi_square,
        })
    });
    let sigma = largest_trunk_sigma(rig);
    json!({
        "rms_px": trunk.rms_px,
        "rms_inlier_px": trunk.rms_inlier_px,
        "corners_total": trunk.corners_total,
        "corners_inlier": trunk.corners_inlier,
        "poses": poses.collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "play": play.collect::<Vec<_>>(),
        "calibration_sigma": {
            "rotation_deg": sigma.0.deg(), "translation_mm": sigma.1.mm(),
        },
        "held_out": held_out.collect::<Vec<_>>(),
    })
}
