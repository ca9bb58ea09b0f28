//! Where board views come from: images, or a CSV file of corners.

use std::path::Path;

use vergence_calibration::{BoardView, IntrinsicsOptions, ReportAbout, StereoView, calibrate_intrinsics};
use vergence_rig::Provenance;
use vergence_vision::{Angle, ImageSize, KannalaBrandt};

use crate::boards::{Boards, detect_in, files};
use crate::cmd::board_options::BoardOptions;
use crate::console::Console;
use crate::corners::{self, FrameView};
use crate::failure::Failure;
use crate::provenance::InputHash;

/// Looks for the board in the images that `patterns` name; images without one are told. Without a `hint`, a camera that is
/// roughly right, it looks twice: the second time with the lens that the first look gives.
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
    let mut boards = detect_in(&files, &board, hint)?;
    if hint.is_none() {
        // Views that give no lens are told apart by the calibration that follows.
        if let Ok(rough) = calibrate_intrinsics(&boards.found(), boards.size, &IntrinsicsOptions::default()) {
            boards = detect_in(&files, &board, Some(&rough.camera))?.or(boards);
        }
    }
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

/// Images of a pair; they pair up in the order of their names.
pub struct PairImages<'a> {
    pub left: &'a [String],
    pub right: &'a [String],
    pub board: &'a BoardOptions,
    /// The cameras, at least roughly.
    pub cameras: (&'a KannalaBrandt, &'a KannalaBrandt),
}

impl PairImages<'_> {
    /// The pairs in which both images show the board.
    ///
    /// # Errors
    /// As [`from_images`]; images that do not pair up, or are not of the cameras' sizes.
    pub fn views(&self, hash: &mut InputHash, console: Console) -> Result<Vec<StereoView>, Failure> {
        let left = from_images(self.left, self.board, Some(self.cameras.0), hash, console)?;
        let right = from_images(self.right, self.board, Some(self.cameras.1), hash, console)?;
        for (name, images, camera) in [("left", left.size, self.cameras.0), ("right", right.size, self.cameras.1)] {
            if images != camera.size() {
                return Err(Failure::usage(format!(
                    "the {name} images are {} x {}, but the {name} camera is one of {} x {}: use the images that the \
                     camera was calibrated with",
                    images.width,
                    images.height,
                    camera.size().width,
                    camera.size().height
                )));
            }
        }
        if left.views.len() != right.views.len() {
            return Err(Failure::usage(format!(
                "{} left images and {} right ones: they must pair up",
                left.views.len(),
                right.views.len()
            )));
        }
        let pairs = left.views.into_iter().zip(right.views);
        Ok(pairs.filter_map(|(left, right)| Some(stereo_view(left.ok()?, right.ok()?))).collect())
    }
}

fn stereo_view(left: BoardView, right: BoardView) -> StereoView {
    StereoView { name: left.name.clone(), left, right }
}

/// The frames of a CSV file that both of its `cameras` have, in their order.
///
/// # Errors
/// As reading the file; other than two cameras.
pub fn pairs_from_corners(
    path: &Path,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<(i64, StereoView)>, Failure> {
    let names = |left: &str, right: &str| Ok((left.to_owned(), right.to_owned()));
    let (left, right) = match cameras {
        [] => names("left", "right"),
        [left, right] => names(left, right),
        _ => Err(Failure::usage("--cameras needs the names of two cameras in the CSV file")),
    }?;
    hash.add(path)?;
    let right: Vec<FrameView> = corners::read(path, Some(&right))?;
    let pair = |left: FrameView| {
        let right = right.iter().find(|right| right.frame == left.frame)?;
        Some((left.frame, stereo_view(left.view, right.view.clone())))
    };
    Ok(corners::read(path, Some(&left))?.into_iter().filter_map(pair).collect())
}

/// The views of one camera in a CSV file.
///
/// # Errors
/// As reading the file.
pub fn from_corners(path: &Path, camera: Option<&str>, hash: &mut InputHash) -> Result<Vec<BoardView>, Failure> {
    hash.add(path)?;
    Ok(corners::read(path, camera)?.into_iter().map(|frame| frame.view).collect())
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

/// What a report says of its origin; `half_field` of the lens where it is known.
#[must_use]
pub fn about(title: String, board: &BoardOptions, provenance: &Provenance, half_field: Option<Angle>) -> ReportAbout {
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
        half_field,
        held_out: None,
    }
}
