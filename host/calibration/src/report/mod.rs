//! Reports: one self-contained HTML page that tells a person how good a calibration is and what would make it better.
//!
//! A page holds its style and its figures (SVG) itself, runs no script and loads nothing. It begins with a verdict in
//! millimetres, for parallel cameras with baseline B that see a point at the distance Z with rays of standard deviation σ:
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
mod intrinsics;
mod pattern;
mod places;
mod ray_field;
mod ray_map;
mod residuals;
mod sections;
mod stage;
mod verdict;

use vergence_page::{Page, escape};
use vergence_vision::Angle;

use crate::Validation;

pub use extrinsics::{extrinsics_report, extrinsics_verdict};
pub use intrinsics::{intrinsics_report, intrinsics_verdict};
pub use stage::stage_report;
pub use verdict::{Verdict, stage_verdict};

/// What a report says of its own origin, and of checks besides the calibration. Every text may hold any characters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportAbout {
    /// The page's title, such as the camera's name.
    pub title: String,
    /// The program that calibrated, and its version.
    pub program_version: String,
    /// SHA-256 of the inputs, in hexadecimal: the same inputs give the same page.
    pub inputs_sha256: String,
    /// When, as it shall be printed.
    pub date: String,
    /// The board, such as "9 × 6 inner corners, 24.23 mm".
    pub board: String,
    /// Half the field of the lens, where it is known: what the coverage is measured against. Otherwise the border of the
    /// sensor is.
    pub half_field: Option<Angle>,
    /// How well views are predicted that the calibration did not see, where that was tried.
    pub held_out: Option<Validation>,
}

/// The whole page of a report; `body` is HTML.
fn page(kind: &'static str, about: &ReportAbout, body: String) -> String {
    let origin =
        vec![("Made by", about.program_version.clone()), ("Date", about.date.clone()), ("Board", about.board.clone())];
    let inputs = escape(&about.inputs_sha256);
    let footer =
        format!("SHA-256 of the inputs: <code>{inputs}</code>. The same inputs give the same page, byte for byte.");
    vergence_page::page(&Page { kind, title: about.title.clone(), origin, body, footer })
}
