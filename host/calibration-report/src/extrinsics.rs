//! The report of a pair.

use nalgebra::Vector3;
use vergence_calibration::{ExtrinsicsCalibration, RelativePose, Side, StereoOutlier, StereoOutlierReason, StereoView};
use vergence_page::{
    Cell, Row, count, counted, figure, figures, fixed, note, number, panel, plain, section, significant, table, text,
    with_sigma,
};
use vergence_vision::{Angle, KannalaBrandt};

use crate::arrows::arrows;
use crate::checks::{self, Check, verdict};
use crate::field_angle::field_angles;
use crate::images::thumbnails;
use crate::intrinsics::IMAGES;
use crate::page;
use crate::pattern::{Neighbours, patches, pattern_px, target_shift_px};
use crate::residuals::{Observation, of_extrinsics};
use crate::result::fixed_pair;
use crate::verdict::{Verdict, in_modes, of_rig};
use crate::{ReportAbout, VerdictPlaces};

/// Most outliers listed one by one.
const MOST_LISTED: usize = 60;

/// The report of an extrinsics calibration: one self-contained HTML page, well-formed as XML.
///
/// `views` are those that `calibration` was made of, in the same order; others give a page whose figures mean nothing.
#[must_use]
pub fn extrinsics_report(calibration: &ExtrinsicsCalibration, views: &[StereoView], about: &ReportAbout) -> String {
    let report = Report::new(calibration, views, about);
    let body = [
        report.verdict_html(),
        report.figures(),
        report.images(views),
        section("Views", &report.view_table()),
        section("Corners left out", &report.outlier_table()),
        report.skipped(),
    ];
    page("Extrinsics calibration", about, body.concat())
}

/// Verdict of the pair of `calibration`, at `places`.
#[must_use]
pub fn extrinsics_verdict(calibration: &ExtrinsicsCalibration, places: &VerdictPlaces) -> Verdict {
    let scatter = calibration.view_scatter;
    let warning = if checks::is_scatter(scatter) {
        let times = significant(scatter, 2);
        format!(" The views disagree {times} times as much as noise explains; this counts it.")
    } else {
        String::new()
    };
    of_rig(&fixed_pair(calibration, ""), places, &warning)
}

struct Report<'a> {
    calibration: &'a ExtrinsicsCalibration,
    about: &'a ReportAbout,
    observations: [Vec<Observation>; 2],
}

impl<'a> Report<'a> {
    fn new(calibration: &'a ExtrinsicsCalibration, views: &[StereoView], about: &'a ReportAbout) -> Self {
        let observations = [Side::Left, Side::Right].map(|side| of_extrinsics(calibration, views, side));
        Self { calibration, about, observations }
    }

    fn cameras(&self) -> [&KannalaBrandt; 2] {
        [&self.calibration.left, &self.calibration.right]
    }

    fn verdict_html(&self) -> String {
        let found = self.calibration;
        let [length, sigma] = baseline(found);
        let [length, sigma] = with_sigma(length, sigma);
        let explanation = format!(
            "The cameras are {length} ± {sigma} mm apart and their axes {}° from each other. Errors are one standard \
             deviation. They count the relative pose, the lenses unless these were held exact, how far the views \
             disagree, and the noise of a matched pixel.",
            fixed(axes_angle(&found.joint).deg(), 2)
        );
        verdict(&extrinsics_verdict(found, &self.about.places).sentence, &explanation, &self.facts(), &self.checks())
    }

    /// Common shift of whole targets, of the camera where it is larger.
    fn target_shift_px(&self) -> Option<f64> {
        self.observations.iter().filter_map(|observations| target_shift_px(observations)).reduce(f64::max)
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let found = self.calibration;
        let used = found.views.iter().filter(|view| view.corners.iter().any(|corners| *corners > 0)).count();
        vec![
            ("Residual, corners used", format!("{} px rms", significant(found.rms_inlier_px, 3))),
            ("Residual, all corners", format!("{} px rms", significant(found.joint.rms_px, 3))),
            ("Residual before the joint fit", format!("{} px rms", significant(found.arun.rms_px, 3))),
            ("Noise of a corner", format!("{} px per axis", significant(found.sigma_px, 3))),
            ("Scatter of the views", format!("{} times what noise explains", significant(found.view_scatter, 2))),
            ("Views", format!("{used} of {} used", found.views.len() + found.skipped.len())),
            ("Corners", format!("{} of {} used", found.corners_inlier, found.corners_total)),
        ]
    }

    fn checks(&self) -> Vec<Check> {
        let found = self.calibration;
        let worse = |sides: &[Option<f64>; 2]| sides.iter().flatten().copied().reduce(f64::max);
        let rms: Vec<_> = found.views.iter().map(|view| (view.view.clone(), worse(&view.rms_px))).collect();
        let pattern = |side: usize, who: &str| {
            let patches = patches(self.cameras()[side].size(), &self.observations[side]);
            let neighbours = Neighbours::of(&self.observations[side]);
            checks::pattern(who, pattern_px(&patches), neighbours, found.sigma_px)
        };
        let checks = [
            Some(view_number(found)),
            Some(checks::scatter(found.view_scatter)),
            pattern(0, " of the left camera"),
            pattern(1, " of the right camera"),
            self.target_shift_px().map(|shift| checks::target_shift(shift, found.rms_inlier_px)),
            Some(checks::views(&rms)),
            Some(checks::outliers(found.corners_total.saturating_sub(found.corners_inlier), found.corners_total)),
            self.about.held_out.as_ref().map(|validation| checks::held_out(validation, found.rms_inlier_px)),
        ];
        checks.into_iter().flatten().collect()
    }

    fn figures(&self) -> String {
        let [left, right] = self.cameras();
        let sigma = self.calibration.sigma_px;
        let rig = fixed_pair(self.calibration, "");
        let depth = in_modes(&rig, &self.about.places).into_iter().map(|mode| mode.depth).map(|depth| {
            figure(
                "Error of a distance",
                &depth.draw(depth.high()),
                "One standard deviation along the line of sight, for points at this distance from the middle of the \
                 baseline, in its plane with straight ahead. Towards the baseline no pair measures depth.",
            )
        });
        let caption = "From where the calibration shows a corner to where it was seen, enlarged as the scale says. The \
                       arrows of one target that all turn one way mean that the cameras did not see it at the same \
                       instant.";
        let angle = "The line is the running root mean square. Red crosses are left out; those at the upper edge lie \
                     above it.";
        let [left_field, right_field] = field_angles(
            [(&self.observations[0], left.theta_max()), (&self.observations[1], right.theta_max())],
            sigma,
        );
        let [left_arrows, right_arrows] = arrows([(left, &self.observations[0]), (right, &self.observations[1])]);
        figures(&[
            figure("Residual arrows, left camera", &left_arrows, caption),
            figure("Residual arrows, right camera", &right_arrows, caption),
            figure("Residual over field angle, left camera", &left_field, angle),
            figure("Residual over field angle, right camera", &right_field, angle),
            depth.collect::<String>(),
            panel(&[("Relative pose", self.pose_table())]),
        ])
    }

    fn images(&self, views: &[StereoView]) -> String {
        let [left, right] = &self.about.images;
        if left.is_empty() && right.is_empty() {
            return String::new();
        }
        let left = thumbnails(left, views.iter().map(|view| &view.left), &self.observations[0]);
        let right = thumbnails(right, views.iter().map(|view| &view.right), &self.observations[1]);
        section("Images", &format!("<h3>Left camera</h3>\n{left}<h3>Right camera</h3>\n{right}{}", note(IMAGES)))
    }

    fn pose_table(&self) -> String {
        let found = self.calibration;
        let sigma = found.covariance.diagonal().map(f64::sqrt);
        let degrees = |pose: &RelativePose| pose.left_from_right.rotation().scaled_axis().map(f64::to_degrees);
        let millimetres = |pose: &RelativePose| pose.left_from_right.origin().mm();
        let vector = |name: &str, [arun, joint]: [Vector3<f64>; 2], sigmas: Vector3<f64>, unit: &str| {
            let row = |axis: usize| {
                let name = format!("{name}, {}", ["x", "y", "z"][axis]);
                pose_row(&name, [arun[axis], joint[axis]], sigmas[axis], unit)
            };
            [0, 1, 2].map(row)
        };
        let both = [&found.arun, &found.joint];
        let turn_sigma = Vector3::new(sigma[0], sigma[1], sigma[2]).map(f64::to_degrees);
        let shift_sigma = Vector3::new(sigma[3], sigma[4], sigma[5]);
        let mut rows = Vec::from(vector("rotation vector", both.map(degrees), turn_sigma, "°"));
        rows.extend(vector("right centre", both.map(millimetres), shift_sigma, "mm"));
        let [length, length_sigma] = baseline(found);
        rows.push(pose_row("baseline", [millimetres(&found.arun).norm(), length], length_sigma, "mm"));
        let angles = [&found.arun, &found.joint].map(|pose| axes_angle(pose).deg());
        rows.push(pose_row("angle between the axes", angles, axes_sigma(found).deg(), "°"));
        rows.push(plain(vec![
            text("residual, all corners"),
            number(Some(found.arun.rms_px), 3),
            number(Some(found.joint.rms_px), 3),
            number(None, 2),
            number(Some(found.joint.rms_px - found.arun.rms_px), 2),
            text("px"),
        ]));
        let explanation = "left_from_right: the right camera in the left camera's frame (x right, y down, z forward). \
                           The start places the targets with each camera alone and fits both sets of corners to each \
                           other; the joint fit of all reprojections is the result. ± of a rotation is a small turn \
                           about that axis of the left camera. ± counts how far the views disagree.";
        table(&["left_from_right", "start", "joint", "± σ", "joint − start", ""], &rows) + &note(explanation)
    }

    fn view_table(&self) -> String {
        let found = self.calibration;
        let rms = |side: usize| found.views.iter().map(|view| view.rms_px[side]).collect::<Vec<_>>();
        let suspects = checks::suspects(&[rms(0), rms(1)].concat());
        let most = [rms(0), rms(1)].concat().into_iter().flatten().fold(0.0, f64::max);
        let row = |(index, view): (usize, &vergence_calibration::StereoViewFigures)| {
            let flags = [index, index + found.views.len()].map(|i| suspects.get(i).copied().unwrap_or(false));
            let is_worst = view.rms_px.iter().flatten().any(|rms| *rms >= most);
            let remark = match (view.rms_px, flags, is_worst) {
                ([None, None], ..) => "not used: the cameras disagree",
                (_, _, true) => "worst",
                (_, [true, true], _) => "stands out",
                (_, [true, false], _) => "left stands out",
                (_, [false, true], _) => "right stands out",
                _ => "",
            };
            let bar = |side: usize| Cell::Bar(view.rms_px[side].map_or(0.0, |rms| rms / most));
            let origin = view.left_from_target.origin().mm();
            Row {
                cells: vec![
                    text(&view.view),
                    count(view.corners[0]),
                    number(view.rms_px[0], 3),
                    bar(0),
                    count(view.corners[1]),
                    number(view.rms_px[1], 3),
                    bar(1),
                    Cell::Number(fixed(origin.norm(), 0)),
                    text(remark),
                ],
                marked: flags.contains(&true) || view.rms_px == [None, None],
            }
        };
        let rows: Vec<Row> = found.views.iter().enumerate().map(row).collect();
        let heads =
            ["View", "left used", "left rms (px)", "", "right used", "right rms (px)", "", "distance (mm)", "remark"];
        table(&heads, &rows) + &note("Distance is that of the target's first corner from the left camera.")
    }

    fn outlier_table(&self) -> String {
        let found = self.calibration;
        let whole = |outlier: &&StereoOutlier| outlier.reason == StereoOutlierReason::ViewRejected;
        let (rejected, mut corners): (Vec<_>, Vec<_>) = found.outliers.iter().partition(whole);
        let mut rows = Vec::new();
        for group in rejected.chunk_by(|a, b| (&a.view, a.side) == (&b.view, b.side)) {
            if let Some(first) = group.first() {
                let which = format!("{} of the view", counted(group.len(), "corner"));
                rows.push(outlier_row(first, which, None));
            }
        }
        // The sort is stable, so that equal residuals stay in the order of the views.
        corners.sort_by(|a, b| b.error_px.total_cmp(&a.error_px));
        for outlier in corners.iter().take(MOST_LISTED) {
            let [x, y] = outlier.target_mm.map(|x| significant(x, 4));
            let [u, v] = [outlier.pixel.u, outlier.pixel.v].map(|x| fixed(x, 1));
            let place = format!("target ({x}, {y}) mm, pixel ({u}, {v})");
            rows.push(outlier_row(outlier, place, Some(outlier.error_px)));
        }
        if rows.is_empty() {
            return note("None.");
        }
        let more = corners.len().saturating_sub(MOST_LISTED);
        let rest = if more > 0 { note(&format!("And {more} more with smaller residuals.")) } else { String::new() };
        table(&["View", "Camera", "Corner", "residual (px)", "Reason"], &rows) + &rest
    }

    fn skipped(&self) -> String {
        let row = |skipped: &vergence_calibration::SkippedView| {
            plain(vec![text(&skipped.view), text(skipped.side.to_string()), text(skipped.reason.to_string())])
        };
        let rows: Vec<Row> = self.calibration.skipped.iter().map(row).collect();
        if rows.is_empty() {
            return String::new();
        }
        section("Views that do not count", &table(&["View", "Camera", "Reason"], &rows))
    }
}

fn pose_row(name: &str, [arun, joint]: [f64; 2], sigma: f64, unit: &str) -> Row {
    let [joint_text, sigma_text] = with_sigma(joint, sigma);
    let [arun_text, _] = with_sigma(arun, sigma);
    let [difference, _] = with_sigma(joint - arun, sigma);
    let numbers = [arun_text, joint_text, sigma_text, difference].map(Cell::Number);
    plain([text(name)].into_iter().chain(numbers).chain([text(unit)]).collect())
}

fn outlier_row(outlier: &StereoOutlier, which: String, residual_px: Option<f64>) -> Row {
    let reason = outlier.reason.to_string();
    let cells =
        vec![text(&outlier.view), text(outlier.side.to_string()), text(which), number(residual_px, 3), text(reason)];
    plain(cells)
}

fn view_number(found: &ExtrinsicsCalibration) -> Check {
    /// Number of views from which one bad view hardly moves the joint fit.
    const ENOUGH: usize = 10;
    let used = found.views.iter().filter(|view| view.corners.iter().any(|corners| *corners > 0)).count();
    let skipped = match found.skipped.len() {
        0 => String::new(),
        more => format!(" {} did not count: one camera sees too little of the target.", counted(more, "view")),
    };
    if used >= ENOUGH {
        Check::good(format!("{} that both cameras see.{skipped}", counted(used, "view")))
    } else {
        Check::attention(format!(
            "Only {} that both cameras see: {ENOUGH} or more make one bad view harmless.{skipped}",
            counted(used, "view")
        ))
    }
}

/// Length and standard deviation in millimetres.
fn baseline(found: &ExtrinsicsCalibration) -> [f64; 2] {
    let origin = found.joint.left_from_right.origin().mm();
    let along = origin.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let shift = found.covariance.fixed_view::<3, 3>(3, 3);
    [origin.norm(), along.dot(&(shift * along)).max(0.0).sqrt()]
}

fn axes_angle(pose: &RelativePose) -> Angle {
    let right = pose.left_from_right.rotation() * Vector3::z();
    Angle::from_rad(right.x.hypot(right.y).atan2(right.z))
}

/// Of [`axes_angle`]: a turn about the normal of both axes changes it. Of parallel axes any normal is one, and the
/// worst counts.
fn axes_sigma(found: &ExtrinsicsCalibration) -> Angle {
    let right = found.joint.left_from_right.rotation() * Vector3::z();
    let turn = found.covariance.fixed_view::<3, 3>(0, 0);
    let variance = match Vector3::z().cross(&right).try_normalize(1e-6) {
        Some(normal) => normal.dot(&(turn * normal)),
        None => turn.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigenvalues().max(),
    };
    Angle::from_rad(variance.max(0.0).sqrt())
}
