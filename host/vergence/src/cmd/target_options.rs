//! How a calibration target is named on the command line.

use std::path::PathBuf;

use vergence_calibration_input::read_target;
use vergence_targets::{AprilGridSpec, CharucoSpec, TagFamily, TargetKind, TargetSpec};
use vergence_vision::Length;

use crate::cmd::force_option::ForceOption;
use crate::console::Console;
use crate::failure::Failure;

/// The target: a chessboard, a ChArUco board, a grid of AprilTags, or what a file says.
#[derive(Clone, Debug, clap::Args)]
pub struct TargetOptions {
    /// A chessboard: its inner corners, such as 9x6.
    #[arg(long = "corners", alias = "board", value_parser = parse_inner_corners, value_name = "CxR")]
    pub inner_corners: Option<(u32, u32)>,
    /// Side of a square of the chessboard or ChArUco board, such as 24.23mm.
    #[arg(long, value_name = "LENGTH")]
    pub square: Option<Length>,
    /// A ChArUco board as OpenCV prints it: its squares across and down, as OpenCV counts them, such as 9x6.
    #[arg(long, value_parser = parse_squares, value_name = "CxR", conflicts_with = "inner_corners")]
    pub charuco: Option<(u32, u32)>,
    /// Side of a marker of the ChArUco board, its black border included, such as 18mm.
    #[arg(long, value_name = "LENGTH", requires = "charuco")]
    pub marker: Option<Length>,
    /// OpenCV's name of the dictionary of the markers: DICT_4X4_50 to DICT_7X7_1000.
    #[arg(long, value_name = "NAME", default_value = "DICT_4X4_50", value_parser = parse_dictionary, requires = "charuco")]
    pub dictionary: TagFamily,
    /// The ChArUco board is as OpenCV before 4.6 drew it: with an even number of rows, a white square at the upper left.
    #[arg(long, requires = "charuco")]
    pub legacy_pattern: bool,
    /// A grid of AprilTags 36h11 as Kalibr prints it: tags across and down, such as 6x6.
    #[arg(long, value_parser = parse_tags, value_name = "CxR", conflicts_with_all = ["inner_corners", "square", "charuco"])]
    pub tags: Option<(u32, u32)>,
    /// Side of a tag, its black border included, such as 24mm.
    #[arg(long, value_name = "LENGTH", requires = "tags")]
    pub tag: Option<Length>,
    /// Space between tags as a part of their side.
    #[arg(long, value_name = "RATIO", default_value_t = 0.3, requires = "tags")]
    pub tag_spacing: f64,
    /// Kalibr's target file (aprilgrid.yaml, checkerboard.yaml) in place of the options above.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["inner_corners", "square", "charuco", "tags"])]
    pub target: Option<PathBuf>,
}

impl TargetOptions {
    /// The target.
    ///
    /// # Errors
    /// Where an option is missing or a length is none, or none that a person can mean.
    pub fn checked_spec(&self, force: ForceOption, console: Console) -> Result<TargetKind, Failure> {
        let spec = self.spec()?;
        force.unless_forced(spec.can_be_held().map_err(Failure::from), console)?;
        Ok(spec)
    }

    /// The target, whatever its size.
    ///
    /// # Errors
    /// Where an option is missing, a length is none, or the file describes no target.
    pub fn spec(&self) -> Result<TargetKind, Failure> {
        if let Some(file) = &self.target {
            return Ok(read_target(file)?);
        }
        let spec = self.named()?;
        let side = spec.side().mm();
        if side.is_nan() || side <= 0.0 {
            return Err(Failure::usage(format!(
                "squares and tags cannot have a side of {}: give a positive length",
                spec.side()
            )));
        }
        match spec {
            TargetKind::AprilGrid(grid) if !grid.is_usable() => {
                Err(Failure::usage("a grid has 1 to 587 tags, and --tag-spacing is more than 0 and at most 1"))
            }
            TargetKind::Charuco(board) if !board.is_usable() => Err(Failure::usage(format!(
                "a ChArUco board has at most as many markers as its dictionary ({} has {}, this board {}), and --marker is more \
                 than 0 and less than --square",
                board.dictionary.name,
                board.dictionary.codes.len(),
                board.markers(),
            ))),
            spec => Ok(spec),
        }
    }

    /// The target that the options name.
    fn named(&self) -> Result<TargetKind, Failure> {
        if let (Some((columns, rows)), Some(tag)) = (self.tags, self.tag) {
            return Ok(TargetKind::AprilGrid(AprilGridSpec { columns, rows, tag, spacing: self.tag_spacing }));
        }
        if let (Some((columns, rows)), Some(square), Some(marker)) = (self.charuco, self.square, self.marker) {
            let (dictionary, legacy) = (self.dictionary, self.legacy_pattern);
            return Ok(TargetKind::Charuco(CharucoSpec { columns, rows, square, marker, dictionary, legacy }));
        }
        // clap lets an option pass without the one that it requires, where that one conflicts with a third.
        if self.marker.is_some() || self.legacy_pattern {
            return Err(Failure::usage("markers are on a ChArUco board: --charuco 9x6 --square 24mm --marker 18mm"));
        }
        if let (Some((columns, rows)), Some(square)) = (self.inner_corners, self.square) {
            return Ok(TargetKind::Chessboard(TargetSpec { columns, rows, square }));
        }
        Err(Failure::usage(
            "describe the target: --corners 9x6 --square 24.23mm, --charuco 9x6 --square 24mm --marker 18mm, \
             --tags 6x6 --tag 24mm, or --target aprilgrid.yaml",
        ))
    }
}

/// `9x6`: columns and rows of inner corners.
fn parse_inner_corners(text: &str) -> Result<(u32, u32), String> {
    if text.ends_with(".csv") {
        return Err("corners in a file are given with --csv".into());
    }
    parse_counts(text, 3).ok_or_else(|| "count the inner corners, such as 9x6, from 3x3 to 99x99".into())
}

/// `9x6`: columns and rows of squares.
fn parse_squares(text: &str) -> Result<(u32, u32), String> {
    parse_counts(text, 3).ok_or_else(|| "count the squares, such as 9x6, from 3x3 to 99x99".into())
}

/// A dictionary of markers by its name.
fn parse_dictionary(text: &str) -> Result<TagFamily, String> {
    TagFamily::dictionary(text).ok_or_else(|| {
        "it is one of DICT_4X4_50, DICT_4X4_100, DICT_4X4_250, DICT_4X4_1000, and the same with 5X5, 6X6 and 7X7".into()
    })
}

/// `6x6`: columns and rows of tags.
fn parse_tags(text: &str) -> Result<(u32, u32), String> {
    parse_counts(text, 1).ok_or_else(|| "count the tags, such as 6x6, from 1x1 to 99x99".into())
}

fn parse_counts(text: &str, least: u32) -> Option<(u32, u32)> {
    let (columns, rows) = text.split_once(['x', 'X', '×'])?;
    let count = |part: &str| part.trim().parse().ok().filter(|n| (least..=99).contains(n));
    Some((count(columns)?, count(rows)?))
}
