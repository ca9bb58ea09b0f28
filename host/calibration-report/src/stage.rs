//! The report of a moving stage.

use vergence_calibration::{FittedScrew, HeldOutPose, StageCalibration, StagePoseFigures};
use vergence_page::{
    Cell, Row, counted, figure, figures, fixed, note, number, panel, plain, section, significant, table, text,
    with_sigma,
};
use vergence_rig::{AxisPosition, Rig, Screw};

use crate::checks::{self, Check, verdict};
use crate::page;
use crate::verdict::{Verdict, in_modes, of_rig};
use crate::{ReportAbout, VerdictPlaces};

/// Number of stage poses from which one bad one is harmless.
const ENOUGH_POSES: usize = 6;
/// 99.9 % quantile of χ² with six degrees of freedom: a stage pose beyond it was not where its encoders read, or the
/// mechanism is not the one drawn.
const CHI_SQUARE_999: f64 = 22.458;

/// The report of a stage calibration: one self-contained HTML page, well-formed as XML.
///
/// `rig` is the rig whose modes the verdict speaks of; `held_out` comes from [`validate_stage`](vergence_calibration::validate_stage) and may be empty.
#[must_use]
pub fn stage_report(stage: &StageCalibration, rig: &Rig, held_out: &[HeldOutPose], about: &ReportAbout) -> String {
    let body = [
        top(stage, rig, held_out, &about.places),
        depth_figures(stage, rig, &about.places),
        section("Stage poses", &pose_table(&stage.poses)),
        section("Stage poses held out", &held_out_table(held_out)),
    ];
    page("Stage calibration", about, body.concat())
}

/// Verdict of a calibrated stage in the modes of `rig`, at `places`.
#[must_use]
pub fn stage_verdict(stage: &StageCalibration, rig: &Rig, places: &VerdictPlaces) -> Verdict {
    let open = match stage.observability.weak.len() {
        0 => String::new(),
        1 => " One combination of the mechanism's unknowns is known from the drawing only.".into(),
        more => format!(" {more} combinations of the mechanism's unknowns are known from the drawing only."),
    };
    of_rig(&stage.rig(rig), places, &open)
}

fn top(stage: &StageCalibration, rig: &Rig, held_out: &[HeldOutPose], places: &VerdictPlaces) -> String {
    let explanation = "One standard deviation. It counts the relative pose that the stage predicts, the encoders, the \
                       lenses unless these were held, how far the views disagree, and the noise of a matched pixel.";
    let facts = [
        ("Residual, corners used", format!("{} px rms", significant(stage.rms_inlier_px, 3))),
        ("Residual, all corners", format!("{} px rms", significant(stage.rms_px, 3))),
        ("Noise of a corner", format!("{} px per axis", significant(stage.sigma_px, 3))),
        ("Scatter of the views", format!("{} times what noise explains", significant(stage.view_scatter, 2))),
        ("Stage poses", stage.poses.len().to_string()),
        ("Corners", format!("{} of {} used", stage.corners_inlier, stage.corners_total)),
        ("Unknowns", format!("{} of {} determined", stage.observability.determined, stage.observability.unknowns)),
    ];
    let mut list = vec![
        number_of_poses(stage.poses.len()),
        observed(stage),
        checks::outliers(stage.corners_total.saturating_sub(stage.corners_inlier), stage.corners_total),
    ];
    list.extend(predicted(held_out));
    verdict(&stage_verdict(stage, rig, places).sentence, explanation, &facts, &list)
}

fn number_of_poses(poses: usize) -> Check {
    if poses >= ENOUGH_POSES {
        Check::good(format!("{}.", counted(poses, "stage pose")))
    } else {
        Check::attention(format!(
            "{} only: three suffice, {ENOUGH_POSES} are recommended.",
            counted(poses, "stage pose")
        ))
    }
}

fn observed(stage: &StageCalibration) -> Check {
    let found = stage.observability.to_string();
    let sentence =
        format!("{}{}.", found.chars().next().map_or('-', |c| c.to_ascii_uppercase()), found.get(1..).unwrap_or(""));
    if stage.observability.weak.is_empty() { Check::good(sentence) } else { Check::attention(sentence) }
}

fn predicted(held_out: &[HeldOutPose]) -> Option<Check> {
    let worst = held_out.iter().max_by(|a, b| a.chi_square.total_cmp(&b.chi_square))?;
    let most = |value: fn(&HeldOutPose) -> f64| held_out.iter().map(value).fold(0.0, f64::max);
    let sentence = format!(
        "Stage poses that the calibration did not see are predicted to {}° and {} mm at worst",
        significant(most(|pose| pose.rotation.deg()), 2),
        significant(most(|pose| pose.translation.mm()), 2)
    );
    Some(if worst.chi_square <= CHI_SQUARE_999 {
        Check::good(format!("{sentence}, as its uncertainty says."))
    } else {
        Check::attention(format!(
            "{sentence}, more than its uncertainty allows: look at the pose at {}.",
            readings(&worst.readings)
        ))
    })
}

fn depth_figures(stage: &StageCalibration, rig: &Rig, places: &VerdictPlaces) -> String {
    let caption = "One standard deviation along the line of sight, for points at this distance from the middle \
                   of the baseline, in its plane with straight ahead. Towards the baseline no pair measures depth.";
    let calibrated = stage.rig(rig);
    let modes = in_modes(&calibrated, places);
    // One scale for all modes, so that the figures compare.
    let high = modes.iter().map(|mode| mode.depth.high()).fold(0.0, f64::max);
    let mut list: Vec<String> = modes
        .iter()
        .map(|mode| figure(&format!("Error of a distance, {}", mode.name), &mode.depth.draw(high), caption))
        .collect();
    list.push(panel(&[("Screws", screw_table(&stage.screws)), ("Encoders", encoder_table(stage))]));
    figures(&list)
}

fn screw_table(screws: &[FittedScrew]) -> String {
    let row = |fitted: &FittedScrew| {
        let (kind, direction, through) = match fitted.screw {
            Screw::Slide { along } => ("slides along", along.into_inner(), None),
            Screw::Turn { about, through } => ("turns about", about.into_inner(), Some(through.mm())),
        };
        let vector = |v: &nalgebra::Vector3<f64>, decimals: i32| {
            format!("({})", v.iter().map(|x| fixed(*x, decimals)).collect::<Vec<_>>().join(", "))
        };
        plain(vec![
            text(fitted.side.to_string()),
            text(&fitted.axis),
            text(format!("{kind} {}", vector(&direction, 5))),
            number(Some(fitted.direction_sigma.deg()), 2),
            text(through.map_or_else(|| "–".to_owned(), |through| vector(&through, 3))),
            number(fitted.position_sigma.map(|sigma| sigma.mm()), 2),
        ])
    };
    let rows: Vec<Row> = screws.iter().map(row).collect();
    let explanation = "In the base frame (x right, y down, z forward; mm) with all encoders reading zero. ± is one \
                       standard deviation along the worse of two axes.";
    table(&["Camera", "Axis", "Screw", "± (°)", "through", "± (mm)"], &rows) + &note(explanation)
}

fn encoder_table(stage: &StageCalibration) -> String {
    let scales = stage.scales.iter().map(|scale| {
        let [value, sigma] = with_sigma(scale.scale, scale.sigma);
        plain(vec![text(&scale.axis), text("scale"), Cell::Number(value), Cell::Number(sigma), text("")])
    });
    let zeros = stage.zero_offsets.iter().map(|zero| {
        let unit = |position: AxisPosition| match position {
            AxisPosition::Linear(length) => (length.mm(), "mm"),
            AxisPosition::Rotary(angle) => (angle.deg(), "°"),
        };
        let ((offset, name), (sigma, _)) = (unit(zero.offset), unit(zero.sigma));
        let [value, sigma] = with_sigma(offset, sigma);
        plain(vec![text(&zero.axis), text("zero"), Cell::Number(value), Cell::Number(sigma), text(name)])
    });
    let rows: Vec<Row> = scales.chain(zeros).collect();
    table(&["Axis", "", "value", "± σ", ""], &rows)
}

fn pose_table(poses: &[StagePoseFigures]) -> String {
    let row = |pose: &StagePoseFigures| {
        plain(vec![
            text(readings(&pose.readings)),
            number(Some(pose.rms_inlier_px), 3),
            number(Some(pose.rotation_difference.deg()), 2),
            number(Some(pose.translation_difference.mm()), 2),
        ])
    };
    let rows: Vec<Row> = poses.iter().map(row).collect();
    let explanation = "The differences are those between the stage's pose and the one that the pose's own views give by \
                       themselves.";
    table(&["Encoders read", "rms (px)", "rotation (°)", "position (mm)"], &rows) + &note(explanation)
}

pub(crate) fn held_out_table(held_out: &[HeldOutPose]) -> String {
    if held_out.is_empty() {
        return note("None: at least four stage poses are needed to leave one out.");
    }
    let row = |pose: &HeldOutPose| Row {
        cells: vec![
            text(readings(&pose.readings)),
            number(Some(pose.rotation.deg()), 2),
            number(Some(pose.translation.mm()), 2),
            number(Some(pose.chi_square), 2),
        ],
        marked: pose.chi_square > CHI_SQUARE_999,
    };
    let rows: Vec<Row> = held_out.iter().map(row).collect();
    let explanation = "Each predicted by a calibration of all the others and compared with its own views. χ² is the square \
                       of the difference in units of its covariance: 6 on average.";
    table(&["Encoders read", "rotation (°)", "position (mm)", "χ²"], &rows) + &note(explanation)
}

fn readings(readings: &[AxisPosition]) -> String {
    readings.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
