//! The report of one lens.

use nalgebra::{Point3, Vector3};
use vergence_calibration::{IntrinsicsCalibration, Outlier, OutlierReason};
use vergence_page::{
    Cell, Row, count, counted, figure, figures, fixed, note, number, panel, plain, section, significant, table, text,
    with_sigma,
};
use vergence_targets::TargetView;
use vergence_vision::{CENTRAL_PARAMETERS, KannalaBrandt};

use crate::ReportAbout;
use crate::arrows::{arrows, mean_arrows};
use crate::checks::{self, Check, verdict};
use crate::coverage::FieldCoverage;
use crate::field_angle::field_angles;
use crate::images::{LitArea, thumbnails};
use crate::page;
use crate::pattern::{Neighbours, Patch, patches, pattern_px};
use crate::ray_field::{BASELINE_MM, RANGE_MM, RayField, Ring, depth_mm};
use crate::ray_map::ray_map;
use crate::residuals::{Observation, of_intrinsics};
use crate::result::{pupil_in_words, step_in_words};
use crate::verdict::Verdict;

/// Most outliers listed one by one.
const MOST_LISTED: usize = 60;
/// Legend below the images.
pub(crate) const IMAGES: &str = "Dots are the corners used, crosses those left out.";

/// The report of an intrinsics calibration: one self-contained HTML page, well-formed as XML.
///
/// `views` are those that `calibration` was made of, in the same order; others give a page whose figures mean nothing.
#[must_use]
pub fn intrinsics_report(calibration: &IntrinsicsCalibration, views: &[TargetView], about: &ReportAbout) -> String {
    let report = Report::new(calibration, views, about);
    let body = [
        report.verdict_html(),
        report.figures(),
        report.images(),
        section("Views", &report.view_table()),
        section("Corners left out", &report.outlier_table()),
    ];
    page("Intrinsics calibration", about, body.concat())
}

/// Verdict of the lens of `calibration`, made from `views`.
#[must_use]
pub fn intrinsics_verdict(calibration: &IntrinsicsCalibration, views: &[TargetView]) -> Verdict {
    Report::new(calibration, views, &ReportAbout::default()).verdict()
}

struct Report<'a> {
    calibration: &'a IntrinsicsCalibration,
    views: &'a [TargetView],
    about: &'a ReportAbout,
    observations: Vec<Observation>,
    patches: Vec<Patch>,
    rays: RayField,
    coverage: FieldCoverage,
}

impl<'a> Report<'a> {
    fn new(calibration: &'a IntrinsicsCalibration, views: &'a [TargetView], about: &'a ReportAbout) -> Self {
        let observations = of_intrinsics(calibration, views);
        let lit = LitArea::of(&about.images[0]);
        Self {
            calibration,
            views,
            about,
            patches: patches(calibration.camera.size(), &observations),
            rays: RayField::of(calibration),
            coverage: FieldCoverage::of(&calibration.camera, about.half_field, lit.as_ref(), &observations),
            observations,
        }
    }

    fn camera(&self) -> &KannalaBrandt {
        &self.calibration.camera
    }

    fn verdict(&self) -> Verdict {
        let Some((median, worst)) = self.rays.median().zip(self.rays.worst()) else {
            let nothing = "No ray of this lens reaches the sensor: it is not usable.".to_owned();
            return Verdict::new(nothing, None, RANGE_MM);
        };
        let [typical, worst] = [median, worst].map(|sample| depth_mm(sample.sigma_rad));
        let mm = |depth: f64| significant(depth, 2);
        let weakest = self.rays.weakest().map_or(String::new(), |weakest| {
            let place = weakest.place.unwrap_or("all around");
            format!("; weakest: {place}, beyond {}° from the axis", fixed(weakest.from_deg, 0))
        });
        let range = fixed(RANGE_MM, 0);
        let pattern = self.pattern_mm().map_or_else(String::new, |mm| {
            format!(" A pattern in the residuals, which is no noise, adds about {} mm.", significant(mm, 2))
        });
        let sentence = format!(
            "Good to {} mm at {range} mm over half of the field, to {} mm at worst{weakest}.{pattern}",
            mm(typical),
            mm(worst)
        );
        Verdict::new(sentence, Some([typical, worst]), RANGE_MM)
    }

    fn verdict_html(&self) -> String {
        let sentence = self.verdict().sentence;
        let Some((median, worst)) = self.rays.median().zip(self.rays.worst()) else {
            return verdict(&sentence, "", &[], &[]);
        };
        let degrees = |sigma: f64| significant(sigma.to_degrees(), 2);
        let explanation = format!(
            "A ray is known to {}° ({} px) in the median over the valid cone and to {}° ({} px) at worst, one standard \
             deviation. Two such lenses {} mm apart measure the distance Z of a point straight ahead to \
             dZ = Z²·σ·√2 / B. Noise of the corners and the scatter of the views are counted, a common turn of all rays \
             is not: the poses take it up.",
            degrees(median.sigma_rad),
            significant(median.sigma_px, 2),
            degrees(worst.sigma_rad),
            significant(worst.sigma_px, 2),
            fixed(BASELINE_MM, 0)
        );
        verdict(&sentence, &explanation, &self.facts(), &self.checks())
    }

    /// Depth error (mm) from systematic residuals; `None` if they do not matter. One of the two components shifts the
    /// depth, at the scale of the image's middle.
    fn pattern_mm(&self) -> Option<f64> {
        let found = self.calibration;
        let pattern = pattern_px(&self.patches).filter(|pattern| checks::is_pattern(*pattern, found.sigma0_px))?;
        Some(depth_mm(pattern / std::f64::consts::SQRT_2 / found.opencv.fx))
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let found = self.calibration;
        vec![
            ("Residual, corners used", format!("{} px rms", significant(found.rms_inlier_px, 3))),
            ("Residual, all corners", format!("{} px rms", significant(found.rms_px, 3))),
            ("Noise of a corner", format!("{} px per axis", significant(found.sigma0_px, 3))),
            ("Scatter of the views", format!("{} times what noise explains", significant(found.view_scatter, 2))),
            ("Views", format!("{} of {} used", found.views_used, self.views.len())),
            ("Corners", format!("{} of {} used", found.corners_inlier, found.corners_total)),
            ("Valid cone", format!("±{}°", fixed(found.camera.theta_max().deg(), 1))),
        ]
    }

    fn checks(&self) -> Vec<Check> {
        let found = self.calibration;
        let rms: Vec<_> = found.views.iter().map(|view| (view.name.clone(), view.rms_inlier_px)).collect();
        let checks = [
            Some(checks::coverage(&self.coverage, self.about.half_field.is_some() || !self.about.images[0].is_empty())),
            Some(checks::tilts(found.tilt_spread.deg())),
            checks::pattern("", pattern_px(&self.patches), Neighbours::of(&self.observations), found.sigma0_px),
            Some(checks::views(&rms)),
            Some(checks::outliers(found.corners_total.saturating_sub(found.corners_inlier), found.corners_total)),
            self.about.held_out.as_ref().map(|validation| checks::held_out(validation, found.rms_inlier_px)),
        ];
        checks.into_iter().flatten().collect()
    }

    fn figures(&self) -> String {
        let found = self.calibration;
        let [arrows] = arrows([(self.camera(), &self.observations)]);
        let [field_angle] = field_angles([(&self.observations, found.camera.theta_max())], found.sigma0_px);
        figures(&[
            figure(
                "Residual arrows",
                &arrows,
                "From where the lens shows a corner to where it was seen, enlarged as the scale says. Arrows of a good \
                 calibration point everywhere; neighbours that agree mean a bent target or a lens the model does not fit.",
            ),
            figure(
                "Coverage",
                &self.coverage.draw(self.camera()),
                "Corners used in each part of the field. Red parts have none: show the target there. The dashed line \
                 is the valid cone; beyond it rays are refused.",
            ),
            figure(
                "Ray uncertainty",
                &ray_map(found),
                "Standard deviation of the ray behind each pixel in its worst direction. Dark is bad: more corners \
                 there help, and corners further out help most.",
            ),
            figure(
                "Residual over field angle",
                &field_angle,
                "The line is the running root mean square. Where it rises, corners are harder to find or the model \
                 fits less. Red crosses are left out; those at the upper edge lie above it.",
            ),
            figure(
                "Mean residual",
                &mean_arrows(self.camera(), &self.patches),
                "The average over patches with corners of three views or more. Noise averages out, so what is left is \
                 error of the model or of the target.",
            ),
            panel(&[
                ("Ray uncertainty by angle to the axis", self.ring_table()),
                ("Parameters", self.parameter_table()),
            ]),
        ])
    }

    fn images(&self) -> String {
        let images = &self.about.images[0];
        if images.is_empty() {
            return String::new();
        }
        section("Images", &(thumbnails(images, self.views.iter(), &self.observations) + &note(IMAGES)))
    }

    fn ring_table(&self) -> String {
        let row = |ring: &Ring| {
            let mrad = |sigma: f64| number(Some(1e3 * sigma), 2);
            plain(vec![
                text(format!("{}° to {}°", fixed(ring.from_deg, 0), fixed(ring.to_deg, 0))),
                mrad(ring.median.sigma_rad),
                mrad(ring.worst.sigma_rad),
                number(Some(ring.median.sigma_px), 2),
                number(Some(ring.worst.sigma_px), 2),
                number(Some(depth_mm(ring.median.sigma_rad)), 2),
                number(Some(depth_mm(ring.worst.sigma_rad)), 2),
            ])
        };
        let heads = ["From the axis", "mrad", "worst", "px", "worst", "mm", "worst"];
        let rows: Vec<Row> = self.rays.rings().iter().map(row).collect();
        let explanation = format!(
            "Medians and worst rays. Millimetres: dZ = Z²·σ·√2 / B of a point straight ahead at Z = {} mm with B = {} \
             mm. In herbivore mode, with the axes 120° apart, straight ahead is 60° from either axis; in human mode it is on it.",
            fixed(RANGE_MM, 0),
            fixed(BASELINE_MM, 0)
        );
        table(&heads, &rows) + &note(&explanation)
    }

    fn parameter_table(&self) -> String {
        let found = self.calibration;
        let names = [
            ["fx", "fy", "cx", "cy"].map(|name| (name, "px")),
            ["k1", "k2", "k3", "k4"].map(|name| (name, "")),
            [("pupil e0", "mm"), ("pupil e1", "mm"), ("p1", ""), ("p2", "")],
            ["s0", "s1", "s2", "s3"].map(|name| (name, "")),
        ];
        let row = |name: &str, value: f64, sigma: f64, unit: &str| {
            let [value, sigma] = with_sigma(value, sigma);
            plain(vec![text(name), Cell::Number(value), Cell::Number(sigma), text(unit)])
        };
        let estimated = |index: usize| index < CENTRAL_PARAMETERS || found.covariance[(index, index)] > 0.0;
        let mut rows: Vec<Row> = names
            .iter()
            .flatten()
            .chain(&[("k5", ""), ("k6", ""), ("p3", ""), ("p4", "")])
            .zip(found.lens().to_array())
            .enumerate()
            .filter(|(index, _)| estimated(*index))
            .map(|(index, ((name, unit), value))| row(name, value, found.covariance[(index, index)].sqrt(), unit))
            .collect();
        if let Some(warp) = &found.warp {
            rows.push(row("target bow along x", warp.shape.along_x_mm, warp.sigma_mm[0], "mm"));
            rows.push(row("target bow along y", warp.shape.along_y_mm, warp.sigma_mm[1], "mm"));
        }
        let explanation = "r = f·θ·(1 + k1·θ² + k2·θ⁴ + k3·θ⁶ + k4·θ⁸), as cv::fisheye and Kalibr's equidistant model, and k5·θ¹⁰ + k6·θ¹² \
                           where they are stated. \
                           σ comes from the noise of the corners, with target poses free. k1 to k4 depend on each \
                           other: two calibrations may differ in them and agree in every ray. Compare rays, not coefficients. \
                           The ray at θ starts (e0 + e1·θ²)·(θ / sin θ − 1) ahead of the origin. p and s move its image m, in focal \
                           lengths from the principal point, by 2 (m·P) m + |m|² P with P = (p1, p2) + |m|² (p3, p4), and (s0 |m|² + s1 |m|⁴, s2 |m|² + s3 |m|⁴).";
        let pupil = format!("By the views {}.", pupil_in_words(&found.pupil));
        let steps: String =
            found.steps.iter().map(|step| note(&format!("By the views {}.", step_in_words(step)))).collect();
        table(&["Parameter", "Value", "± σ", ""], &rows) + &note(explanation) + &note(&pupil) + &steps
    }

    fn view_table(&self) -> String {
        let found = self.calibration;
        let rms: Vec<Option<f64>> = found.views.iter().map(|view| view.rms_inlier_px).collect();
        let most = rms.iter().flatten().copied().fold(0.0, f64::max);
        let suspects = checks::suspects(&rms);
        let row = |((view, target), suspect): ((&vergence_calibration::ViewFigures, &TargetView), bool)| {
            let placed = view.pose.as_ref().and_then(|pose| placement(target, pose.camera_from_target.isometry()));
            let is_worst = view.rms_inlier_px.is_some_and(|rms| rms >= most);
            let remark = match (view.rms_inlier_px, is_worst, suspect) {
                (None, ..) => "not used",
                (_, true, true) => "worst, stands out",
                (_, true, false) => "worst",
                (_, _, true) => "stands out",
                _ => "",
            };
            Row {
                cells: vec![
                    text(&view.name),
                    count(view.corners_inlier),
                    count(view.corners.saturating_sub(view.corners_inlier)),
                    number(view.rms_inlier_px, 3),
                    Cell::Bar(view.rms_inlier_px.map_or(0.0, |rms| rms / most)),
                    Cell::Number(placed.map_or_else(|| "–".to_owned(), |p| fixed(p.tilt_deg, 0))),
                    Cell::Number(placed.map_or_else(|| "–".to_owned(), |p| fixed(p.theta_deg, 0))),
                    Cell::Number(placed.map_or_else(|| "–".to_owned(), |p| fixed(p.distance_mm, 0))),
                    text(remark),
                ],
                marked: suspect || view.rms_inlier_px.is_none(),
            }
        };
        let rows: Vec<Row> = found.views.iter().zip(self.views).zip(suspects).map(row).collect();
        let heads = ["View", "used", "left out", "rms (px)", "", "tilt (°)", "off axis (°)", "distance (mm)", "remark"];
        let explanation = "Tilt is the angle between the target's normal and the line of sight to its middle; off axis \
                           is the angle of that line to the optical axis.";
        table(&heads, &rows) + &note(explanation)
    }

    fn outlier_table(&self) -> String {
        let found = self.calibration;
        let name = |view: usize| self.views.get(view).map_or("", |view| view.name.as_str());
        let (mut corners, whole): (Vec<&Outlier>, Vec<&Outlier>) =
            found.outliers.iter().partition(|outlier| outlier.reason == OutlierReason::TooFar);
        let mut rows = Vec::new();
        for group in whole.chunk_by(|a, b| (a.view, a.reason) == (b.view, b.reason)) {
            if let Some(first) = group.first() {
                let which = format!("{} of the view", counted(group.len(), "corner"));
                rows.push(plain(vec![
                    text(name(first.view)),
                    text(which),
                    number(None, 3),
                    text(first.reason.to_string()),
                ]));
            }
        }
        corners.sort_by(|a, b| {
            let residual = |o: &Outlier| o.residual_px.unwrap_or(f64::INFINITY);
            residual(b).total_cmp(&residual(a)).then((a.view, a.corner).cmp(&(b.view, b.corner)))
        });
        for outlier in corners.iter().take(MOST_LISTED) {
            let corner = self.views.get(outlier.view).and_then(|view| view.corners.get(outlier.corner));
            let place = corner.map_or_else(String::new, |corner| {
                let [x, y] = corner.target_mm.map(|x| significant(x, 4));
                let [u, v] = [corner.pixel.u, corner.pixel.v].map(|x| fixed(x, 1));
                format!("target ({x}, {y}) mm, pixel ({u}, {v})")
            });
            rows.push(plain(vec![
                text(name(outlier.view)),
                text(place),
                number(outlier.residual_px, 3),
                text(outlier.reason.to_string()),
            ]));
        }
        if rows.is_empty() {
            return note("None.");
        }
        let more = corners.len().saturating_sub(MOST_LISTED);
        let rest = if more > 0 { note(&format!("And {more} more with smaller residuals.")) } else { String::new() };
        table(&["View", "Corner", "residual (px)", "Reason"], &rows) + &rest
    }
}

/// Placement of a target before the camera.
#[derive(Clone, Copy)]
struct Placement {
    tilt_deg: f64,
    theta_deg: f64,
    distance_mm: f64,
}

fn placement(view: &TargetView, camera_from_target: &nalgebra::Isometry3<f64>) -> Option<Placement> {
    let count = view.corners.len() as f64;
    let mean = |axis: usize| view.corners.iter().map(|corner| corner.target_mm[axis]).sum::<f64>() / count;
    let middle = (camera_from_target * Point3::new(mean(0), mean(1), 0.0)).coords;
    let normal = camera_from_target.rotation * Vector3::z();
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
    let tilt_deg = angle(&normal, &middle);
    let placement = Placement {
        tilt_deg: tilt_deg.min(180.0 - tilt_deg),
        theta_deg: angle(&middle, &Vector3::z()),
        distance_mm: middle.norm(),
    };
    placement.distance_mm.is_finite().then_some(placement)
}
