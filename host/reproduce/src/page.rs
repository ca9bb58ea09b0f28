//! All of it on one self-contained page.

mod bench;
mod causes;
mod matching;
mod triangulation;
mod zones;

use std::io::Cursor;

use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use vergence_page::{Page, data_url, note, page, section};
use vergence_scene::LensChoice;

use super::matching::Matching;
use super::tally::Table;
use super::zones::ModeZones;
use crate::causes::Column;
use crate::error::ReproduceError;

/// Everything that the page shows.
pub struct Findings<'a> {
    /// The bench with corners of the class that the goals are for, and with twice the noise.
    pub tables: [&'a Table; 2],
    /// Each kind of error alone, and all together.
    pub columns: &'a [Column],
    /// Whether photographs were rendered, or corners only projected.
    pub rendered: bool,
    /// The lenses that photographed the targets.
    pub lens: LensChoice,
    /// Zones of all modes.
    pub zones: &'a [ModeZones],
    /// Curves of the zones of the herbivore mode over separation and over radius, as SVG.
    pub zones_svg: &'a str,
    /// Results of all matchers in all modes.
    pub matchings: &'a [Matching],
    /// A mode and what both cameras see of the target.
    pub targets: &'a [(&'static str, RgbImage)],
    /// Samples of the study of triangulation.
    pub samples: u32,
    /// The command that made the page.
    pub command: String,
}

/// The page.
///
/// # Errors
/// Where a picture cannot be encoded.
pub fn reproduction_page(findings: &Findings<'_>) -> Result<String, ReproduceError> {
    let body = [
        bench::verdict(findings),
        section("Precision bench", &bench::body(findings)?),
        section("The methods by the cause of their errors", &causes::body(findings.columns, findings.lens)),
        section("Zones", &zones::body(findings)),
        section("Methods of triangulation", &triangulation::body(findings.samples)),
        section("Matches in the simulated room", &matching::body(findings.matchings)?),
    ];
    Ok(page(&Page {
        kind: "Reproduction",
        title: "The paper's experiments, simulated".into(),
        origin: vec![
            ("Made by", concat!("vergence ", env!("CARGO_PKG_VERSION")).into()),
            ("Command", findings.command.clone()),
            ("Lenses", format!("{} on the bench, ideal ones in the simulated room", findings.lens)),
        ],
        body: body.concat(),
        footer: note(
            "The paper: \"Bio-inspired reconfigurable stereo vision for robotics using omnidirectional cameras\". The \
             same command gives the same page, byte for byte, on the same machine.",
        ),
    }))
}

/// A picture as the page holds it.
fn jpeg(picture: &RgbImage) -> Result<String, ReproduceError> {
    const QUALITY: u8 = 82;
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, QUALITY))
        .map_err(|error| ReproduceError::Picture(error.to_string()))?;
    Ok(data_url("image/jpeg", bytes.get_ref()))
}
