//! The report of a folding trunk.

use vergence_calibration::{HeldOutPose, TrunkCalibration, TrunkParameterFigures};
use vergence_page::{
    Cell, Row, counted, figure, figures, fixed, note, number, plain, section, significant, table, text, with_sigma,
};
use vergence_rig::{Rig, positions_in_words};

use crate::checks::{self, Check, verdict};
use crate::page;
use crate::result::{in_unit, play_in_words, unit};
use crate::stage::held_out_table;
use crate::verdict::{in_modes, trunk_verdict};
use crate::{ReportAbout, VerdictPlaces};

/// Number of stage poses from which play and numbers part well: three readings of corners at each, of which the images need two.
const ENOUGH_POSES: usize = 10;

/// The report of a trunk's calibration, which made `rig`: one self-contained HTML page, well-formed as XML. `held_out` comes from
/// [`validate_trunk`](vergence_calibration::validate_trunk) and may be empty.
#[must_use]
pub fn trunk_report(trunk: &TrunkCalibration, rig: &Rig, held_out: &[HeldOutPose], about: &ReportAbout) -> String {
    let body = [
        top(trunk, rig, &about.places),
        depth_figures(rig, &about.places),
        section("Numbers of the trunk", &parameter_table(&trunk.parameters)),
        section("Stage poses", &pose_table(trunk)),
        section("Stage poses held out", &held_out_table(held_out)),
    ];
    page("Trunk calibration", about, body.concat())
}

fn top(trunk: &TrunkCalibration, rig: &Rig, places: &VerdictPlaces) -> String {
    let explanation = "One standard deviation. It counts the relative pose by the joints alone, their play included, the lenses \
                       unless these were held, and the noise of a matched pixel.";
    let [corners, folds] = [0, 1].map(|group: usize| trunk.play.get(group).map(play_in_words).unwrap_or_default());
    let facts = [
        ("Residual, corners used", format!("{} px rms", significant(trunk.rms_inlier_px, 3))),
        ("Residual, all corners", format!("{} px rms", significant(trunk.rms_px, 3))),
        ("Noise of a corner", format!("{} px per axis", significant(trunk.sigma_px, 3))),
        ("Stage poses", trunk.poses.len().to_string()),
        ("Play of the corners", corners),
        ("Play of the folds", folds),
    ];
    let poses = counted(trunk.poses.len(), "stage pose");
    let number = if trunk.poses.len() >= ENOUGH_POSES {
        Check::good(format!("{poses}."))
    } else {
        Check::attention(format!(
            "{poses} only: three suffice, {ENOUGH_POSES} are recommended, so that they tell the play."
        ))
    };
    let list =
        [number, checks::outliers(trunk.corners_total.saturating_sub(trunk.corners_inlier), trunk.corners_total)];
    verdict(&trunk_verdict(rig, places).sentence, explanation, &facts, &list)
}

fn depth_figures(rig: &Rig, places: &VerdictPlaces) -> String {
    let caption = "One standard deviation along the line of sight by the joints alone, for points at this distance from \
                   the middle of the baseline, in its plane with straight ahead.";
    let modes = in_modes(rig, places);
    let list: Vec<String> = modes
        .iter()
        .map(|mode| {
            figure(&format!("Error of a distance, {}", mode.name), &mode.depth.draw(mode.depth.high()), caption)
        })
        .collect();
    figures(&list)
}

fn parameter_table(parameters: &[TrunkParameterFigures]) -> String {
    let row = |figures: &TrunkParameterFigures| {
        let [value, sigma] = with_sigma(in_unit(figures, figures.value), in_unit(figures, figures.sigma));
        plain(vec![
            text(figures.name),
            Cell::Number(value),
            Cell::Number(sigma),
            text(unit(figures)),
            text(fixed(in_unit(figures, figures.drawn), 3)),
            text(fixed(in_unit(figures, figures.tolerance), 3)),
            text(format!("{} %", fixed(100.0 * figures.from_images(), 0))),
        ])
    };
    let rows: Vec<Row> = parameters.iter().map(row).collect();
    let explanation = "The last column is the share of what is known that the images told; the rest is the drawing with its \
                       tolerance. Two cameras tell only their relative pose, so the left mount trades with the zero of the front \
                       corner; together they are known better than each.";
    table(&["", "value", "± σ", "", "drawn", "tolerance", "from images"], &rows) + &note(explanation)
}

fn pose_table(trunk: &TrunkCalibration) -> String {
    let row = |pose: &vergence_calibration::TrunkPoseFigures| {
        let worst = pose.reading_errors.iter().map(|error| error.deg().abs()).fold(0.0, f64::max);
        let cells = vec![
            text(positions_in_words(&pose.readings)),
            number(Some(pose.rms_inlier_px), 3),
            number(Some(worst), 2),
            number(Some(pose.rotation_difference.deg()), 2),
            number(Some(pose.translation_difference.mm()), 2),
        ];
        Row { cells, marked: pose.is_strained }
    };
    let rows: Vec<Row> = trunk.poses.iter().map(row).collect();
    let explanation = "A joint is off its reading by play, and by what strains \
                       the links; marked is where it is more than play explains. The differences are those between the \
                       trunk's pose and the one that the pose's own views give by themselves.";
    table(&["Encoders read", "rms (px)", "joint off (°)", "rotation (°)", "position (mm)"], &rows) + &note(explanation)
}
