//! The result of a stage calibration as lines of text and as JSON.

use serde_json::{Value, json};
use vergence_calibration::{HeldOutPose, StageCalibration};
use vergence_rig::{AxisPosition, Rig, RigAxis, Screw, positions_in_words};

use super::intrinsics::{bow_in_words, bow_json};

/// The result of a stage calibration as lines for people; `held_out` are the stage poses that were left out in turn.
#[must_use]
pub fn stage_lines(stage: &StageCalibration, held_out: &[HeldOutPose]) -> Vec<String> {
    let mut lines = vec![format!(
        "{} stage poses, {} of {} corners: {:.3} px rms ({:.3} px with the outliers)",
        stage.poses.len(),
        stage.corners_inlier,
        stage.corners_total,
        stage.rms_inlier_px,
        stage.rms_px
    )];
    for pose in &stage.poses {
        lines.push(format!(
            "  at {}: {:.3} px rms; {:.4}° and {:.3} mm from the pose of its own views",
            positions_in_words(&pose.readings),
            pose.rms_inlier_px,
            pose.rotation_difference.deg(),
            pose.translation_difference.mm()
        ));
    }
    for fitted in &stage.screws {
        let place = fitted.position_sigma.map(|sigma| format!(", {:.3} mm", sigma.mm())).unwrap_or_default();
        let sigma = fitted.direction_sigma.deg();
        lines.push(format!("  screw of {} ({} camera): known to {sigma:.4}°{place}", fitted.axis, fitted.side));
    }
    for scale in &stage.scales {
        lines.push(format!("  scale of {}: {:.6} ± {:.6}", scale.axis, scale.scale, scale.sigma));
    }
    for zero in &stage.zero_offsets {
        lines.push(format!("  zero of {}: {} ± {}", zero.axis, zero.offset, zero.sigma));
    }
    for (axis, play) in stage.plays() {
        lines.push(format!(
            "  play of {axis}: {play}. The images put it so far beside its readings: it has play, or its screw or rail is not straight or even"
        ));
    }
    lines.extend(stage.repeatability.map(|found| {
        let (turn, shift) = (found.rotation.deg(), found.translation.mm());
        format!(
            "  returns: the right camera stands {turn:.4}° and {shift:.4} mm beside where the axes put it, in each component, differently at every \
             stage pose: a carriage tilts, or a mount gives"
        )
    }));
    lines.extend(stage.warp.map(|warp| format!("  {}", bow_in_words(&warp))));
    for skipped in &stage.skipped {
        lines.push(format!("  view not used: {} ({} camera: {})", skipped.view, skipped.side, skipped.reason));
    }
    for pose in held_out {
        let readings = positions_in_words(&pose.readings);
        let (turn, shift) = (pose.rotation.deg(), pose.translation.mm());
        lines.push(format!("  without the pose at {readings} it is predicted to {turn:.4}° and {shift:.3} mm"));
    }
    lines.push(format!("  {}", stage.observability));
    lines
}

/// The result of a stage calibration of `rig` for programs; `held_out` are the stage poses that were left out in turn.
#[must_use]
pub fn stage_json(rig: &Rig, stage: &StageCalibration, held_out: &[HeldOutPose]) -> Value {
    let readings = |positions: &[AxisPosition]| -> Value {
        let entries = rig.axes.iter().zip(positions).map(|(axis, &at)| (RigAxis::column(axis), json!(at.mm_or_deg())));
        Value::Object(entries.collect())
    };
    let poses: Vec<_> = stage
        .poses
        .iter()
        .map(|pose| {
            json!({
                "readings": readings(&pose.readings),
                "rms_inlier_px": pose.rms_inlier_px,
                "rotation_difference_deg": pose.rotation_difference.deg(),
                "translation_difference_mm": pose.translation_difference.mm(),
            })
        })
        .collect();
    let screws: Vec<_> = stage
        .screws
        .iter()
        .map(|fitted| {
            let (kind, direction, through) = match fitted.screw {
                Screw::Slide { along } => ("slide", along.into_inner(), None),
                Screw::Turn { about, through } => ("turn", about.into_inner(), Some(through.mm())),
            };
            json!({
                "camera": fitted.side.to_string(), "axis": fitted.axis, "kind": kind,
                "direction": direction.as_slice(), "direction_sigma_deg": fitted.direction_sigma.deg(),
                "through_mm": through.map(|through| through.as_slice().to_vec()),
                "position_sigma_mm": fitted.position_sigma.map(|sigma| sigma.mm()),
            })
        })
        .collect();
    let scales: Vec<_> =
        stage.scales.iter().map(|s| json!({ "axis": s.axis, "scale": s.scale, "sigma": s.sigma })).collect();
    let zeros: Vec<_> = stage
        .zero_offsets
        .iter()
        .map(|zero| json!({ "axis": zero.axis, "offset": zero.offset.mm_or_deg(), "sigma": zero.sigma.mm_or_deg() }))
        .collect();
    let plays: Vec<_> =
        stage.plays().iter().map(|(axis, play)| json!({ "axis": axis, "play": play.mm_or_deg() })).collect();
    let held_out: Vec<_> = held_out
        .iter()
        .map(|pose| {
            json!({
                "readings": readings(&pose.readings), "rotation_deg": pose.rotation.deg(),
                "translation_mm": pose.translation.mm(), "chi_square": pose.chi_square,
            })
        })
        .collect();
    let weak: Vec<_> = stage
        .observability
        .weak
        .iter()
        .map(|weak| json!({ "unknowns": weak.unknowns, "sigma_in_tolerances": weak.sigma }))
        .collect();
    let sigma = stage.largest_sigma();
    json!({
        "rms_px": stage.rms_px,
        "view_scatter": stage.view_scatter,
        "target_bow": bow_json(stage.warp),
        "rms_inlier_px": stage.rms_inlier_px,
        "corners_total": stage.corners_total,
        "corners_inlier": stage.corners_inlier,
        "poses": poses,
        "screws": screws,
        "scales": scales,
        "zero_offsets": zeros,
        "plays": plays,
        "repeatability": stage.repeatability.map(|found| {
            json!({ "rotation_deg": found.rotation.deg(), "translation_mm": found.translation.mm() })
        }),
        "at_zero": {
            "translation_mm": stage.at_zero.left_from_right.origin().mm().as_slice(),
            "rotation_vector": stage.at_zero.left_from_right.rotation().scaled_axis().as_slice(),
            "sigma": stage.at_zero.covariance.diagonal().map(f64::sqrt).as_slice(),
        },
        "calibration_sigma": {
            "rotation_deg": sigma.0.deg(), "translation_mm": sigma.1.mm(),
        },
        "observability": {
            "unknowns": stage.observability.unknowns,
            "determined": stage.observability.determined,
            "weak": weak,
            "next_pose": readings(&stage.observability.next_pose),
            "text": stage.observability.to_string(),
        },
        "held_out": held_out,
    })
}
