//! Reports: one self-contained HTML page that tells a person how good a calibration is and what would make it better.
//!
//! A page holds its style and its figures (SVG) itself, runs no script and loads nothing. It begins with a verdict in
//! millimetres. That of a pair or a rig is the covariance of a point by lenses, pose, encoders and pixels. That of one lens
//! holds for parallel cameras with baseline B that see a point at the distance Z with rays of standard deviation σ:
//!
//! ```text
//! dZ = Z² σ √2 / B        Z = 350 mm, B = 145 mm
//! ```

mod arrows;
mod checks;
mod colour;
mod coverage;
mod depth;
mod extrinsics;
mod field_angle;
mod image_frame;
mod images;
mod intrinsics;
mod pattern;
mod places;
mod ray_field;
mod ray_map;
mod residuals;
mod result;
mod stage;
mod trunk;
mod verdict;

use vergence_calibration::Validation;
use vergence_page::{Page, Row, escape, plain, section, table, text};
use vergence_rig::Provenance;
use vergence_targets::TargetKind;
use vergence_vision::Angle;

pub use extrinsics::{extrinsics_report, extrinsics_verdict};
pub use images::ReportImage;
pub use intrinsics::{intrinsics_report, intrinsics_verdict};
pub use places::{InvalidPlaces, VerdictPlaces};
pub use result::{
    extrinsics_json, extrinsics_lines, fixed_pair, held_out_json, held_out_line, intrinsics_json, intrinsics_lines,
    left_out_json, stage_json, stage_lines, trunk_json, trunk_lines,
};
pub use stage::{stage_report, stage_verdict};
pub use trunk::trunk_report;
pub use verdict::{PlaceVerdict, Verdict, trunk_verdict};

/// Origin of a report, and what it shows besides the calibration. Texts may hold any characters: they are escaped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportAbout {
    /// Title of the page, such as the camera's name.
    pub title: String,
    /// Name and version of the program that calibrated.
    pub program_version: String,
    /// SHA-256 of the inputs, in hexadecimal: the same inputs give the same page.
    pub inputs_sha256: String,
    /// Date, as printed.
    pub date: String,
    /// The target, such as "9 × 6 inner corners, 24.23 mm".
    pub target: String,
    /// Half the field of the lens, if known. Coverage is measured against it, otherwise against the sensor's border.
    pub half_field: Option<Angle>,
    /// Views that were left out before the calibration.
    pub left_out: Vec<LeftOut>,
    /// Where the verdict of a pair or a rig is told.
    pub places: VerdictPlaces,
    /// Prediction error of held-out views, if that was tried.
    pub held_out: Option<Validation>,
    /// The images of the left or only camera, and of the right, in which the target was looked for; may be empty.
    pub images: [Vec<ReportImage>; 2],
}

impl ReportAbout {
    /// The heading of a report: title, origin and target; without a target the corners came from a file. `half_field` is half
    /// the field of the lens by its data sheet.
    #[must_use]
    pub fn new(title: String, target: Option<&TargetKind>, provenance: &Provenance, half_field: Option<Angle>) -> Self {
        let target = target.map_or_else(|| "as in the corner file".into(), ToString::to_string);
        Self {
            title,
            program_version: provenance.program.clone(),
            inputs_sha256: provenance.inputs_sha256.clone(),
            date: provenance.date.clone().unwrap_or_default(),
            target,
            half_field,
            ..Self::default()
        }
    }

    /// The same for a pair or a rig: where its verdict is told, and the views left out before the calibration.
    #[must_use]
    pub fn of_rig(self, places: &VerdictPlaces, left_out: &[LeftOut]) -> Self {
        Self { places: places.clone(), left_out: left_out.to_vec(), ..self }
    }
}

/// A view that was left out before the calibration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Name of the view.
    pub view: String,
    /// Why it is left out, as the end of a sentence.
    pub reason: String,
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: left out: {}", self.view, self.reason)
    }
}

/// The views that were left out, for a report.
fn left_out_section(left_out: &[LeftOut]) -> String {
    if left_out.is_empty() {
        return String::new();
    }
    let row = |left_out: &LeftOut| plain(vec![text(&left_out.view), text(&left_out.reason)]);
    let rows: Vec<Row> = left_out.iter().map(row).collect();
    section("Views left out before the calibration", &table(&["View", "Reason"], &rows))
}

/// Whole page of a report; `body` is HTML.
fn page(kind: &'static str, about: &ReportAbout, body: String) -> String {
    let body = body + &left_out_section(&about.left_out);
    let origin = vec![
        ("Made by", about.program_version.clone()),
        ("Date", about.date.clone()),
        ("Target", about.target.clone()),
    ];
    let inputs = escape(&about.inputs_sha256);
    let footer =
        format!("SHA-256 of the inputs: <code>{inputs}</code>. The same inputs give the same page, byte for byte.");
    vergence_page::page(&Page { kind, title: about.title.clone(), origin, body, footer })
}
