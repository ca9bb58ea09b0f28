//! Where board views come from: images, or a CSV file of corners.

use std::path::Path;

use vergence_calibration::{BoardView, ReportAbout};
use vergence_rig::Provenance;
use vergence_vision::{ImageSize, KannalaBrandt};

use crate::boards::{Boards, detect_in, files};
use crate::cmd::board_options::BoardOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;

/// Looks for the board in the images that `patterns` name; images without one are told.
///
/// # Errors
/// No images, or no board in any of them.
pub fn from_images(
    patterns: &[String],
    board: &BoardOptions,
    hint: Option<&KannalaBrandt>,
    hash: &mut InputHash,
    console: Console,
) -> Result<Boards, Failure> {
    let board = board.spec()?;
    let files = files(patterns)?;
    for file in &files {
        hash.add(file)?;
    }
    let progress = console.progress(&format!("looking for the board in {} images", files.len()));
    let boards = detect_in(&files, &board, hint)?;
    progress.finish_and_clear();
    for (name, reason) in boards.missed() {
        console.say(format!("{name}: {reason}"))?;
    }
    if boards.found().is_empty() {
        let reason = boards.missed().next().map(|(name, reason)| format!("{name}: {reason}")).unwrap_or_default();
        return Err(Failure::usage(format!("no board in any of {} images ({reason})", files.len())));
    }
    Ok(boards)
}

/// The views of one camera in a CSV file.
///
/// # Errors
/// As reading the file.
pub fn from_corners(path: &Path, camera: Option<&str>, hash: &mut InputHash) -> Result<Vec<BoardView>, Failure> {
    hash.add(path)?;
    Ok(crate::corners::read(path, camera)?.into_iter().map(|frame| frame.view).collect())
}

/// `960x600`.
///
/// # Errors
/// Says what is expected.
pub fn parse_size(text: &str) -> Result<ImageSize, String> {
    const HINT: &str = "write width x height in pixels, such as 960x600";
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or(HINT)?;
    let count = |part: &str| part.trim().parse().ok().filter(|n| (1..=100_000).contains(n)).ok_or(HINT);
    Ok(ImageSize { width: count(width)?, height: count(height)? })
}

/// What a report says of its origin.
#[must_use]
pub fn about(title: String, board: &BoardOptions, provenance: &Provenance) -> ReportAbout {
    let board = board.spec().map_or_else(
        |_| "as in the corner file".into(),
        |spec| format!("{} × {} inner corners, {}", spec.columns, spec.rows, spec.square),
    );
    ReportAbout {
        title,
        program_version: provenance.program.clone(),
        inputs_sha256: provenance.inputs_sha256.clone(),
        date: provenance.date.clone().unwrap_or_default(),
        board,
        half_field: None,
    }
}
