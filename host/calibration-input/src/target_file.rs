//! Files that describe a calibration target, as Kalibr reads and documents them.

use std::path::Path;

use serde::Deserialize;
use vergence_targets::{AprilGridSpec, TargetKind, TargetSpec};
use vergence_vision::Length;

use crate::InputError;

/// Kalibr's target files (<https://github.com/ethz-asl/kalibr/wiki/calibration-targets>): lengths in metres. A key that is not
/// known is refused: it may mean another target.
#[derive(Deserialize)]
#[serde(tag = "target_type", rename_all = "lowercase", deny_unknown_fields)]
enum File {
    #[serde(rename_all = "camelCase")]
    AprilGrid { tag_cols: u32, tag_rows: u32, tag_size: f64, tag_spacing: f64 },
    #[serde(rename_all = "camelCase")]
    Checkerboard { target_cols: u32, target_rows: u32, row_spacing_meters: f64, col_spacing_meters: f64 },
}

/// Reads the target that a file of Kalibr's describes.
///
/// # Errors
/// [`InputError`] where the file cannot be read, is none of Kalibr's, or describes no target that can be.
pub fn read_target(path: &Path) -> Result<TargetKind, InputError> {
    let wrong = |problem: String| InputError::wrong(path, problem);
    let bytes = vergence_files::read(path)?;
    let text = String::from_utf8(bytes).map_err(|_| wrong("it is not UTF-8 text".into()))?;
    let file: File = serde_saphyr::from_str(&text).map_err(|error| {
        wrong(format!("it is no target file of Kalibr's, with target_type 'aprilgrid' or 'checkerboard': {error}"))
    })?;
    match file {
        File::AprilGrid { tag_cols, tag_rows, tag_size, tag_spacing } => {
            let tag = Length::from_mm(1000.0 * tag_size);
            let grid = AprilGridSpec { columns: tag_cols, rows: tag_rows, tag, spacing: tag_spacing };
            let usable = grid.is_usable().then_some(TargetKind::AprilGrid(grid));
            usable.ok_or_else(|| {
                wrong("tagCols times tagRows is 1 to 587, tagSize is positive, tagSpacing is 0 to 1".into())
            })
        }
        File::Checkerboard { target_cols, target_rows, row_spacing_meters, col_spacing_meters } => {
            let square = Length::from_mm(1000.0 * row_spacing_meters);
            let is_square = (row_spacing_meters - col_spacing_meters).abs() <= f64::EPSILON * row_spacing_meters;
            if !is_square || square.mm().is_nan() || square.mm() <= 0.0 {
                return Err(wrong(
                    "rowSpacingMeters and colSpacingMeters are the side of a square, and positive".into(),
                ));
            }
            Ok(TargetKind::Chessboard(TargetSpec { columns: target_cols, rows: target_rows, square }))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;

    fn read(text: &str) -> Result<TargetKind, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("target.yaml");
        std::fs::write(&path, text).unwrap();
        read_target(&path).map_err(|error| error.to_string())
    }

    /// The file of Kalibr's documentation, comments and all.
    #[test]
    fn kalibrs_files_are_read_as_they_are() {
        let grid = "target_type: 'aprilgrid' #gridtype\ntagCols: 6               #number of apriltags\n\
                    tagRows: 5               #number of apriltags\ntagSize: 0.088           #size of apriltag, edge to edge [m]\n\
                    tagSpacing: 0.3          #ratio of space between tags to tagSize\n";
        let tag = Length::from_mm(88.0);
        assert_eq!(read(grid), Ok(TargetKind::AprilGrid(AprilGridSpec { columns: 6, rows: 5, tag, spacing: 0.3 })));
        let board = "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n";
        let square = Length::from_mm(60.0);
        assert_eq!(read(board), Ok(TargetKind::Chessboard(TargetSpec { columns: 6, rows: 7, square })));
    }

    #[test]
    fn other_files_are_refused_with_what_is_wrong() {
        let grid = "target_type: aprilgrid\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n";
        for (text, word) in [
            (grid.replace("tagSize: 0.088\n", ""), "tagSize"),
            (grid.replace("aprilgrid", "circlegrid"), "circlegrid"),
            (grid.replace("0.088", "-1"), "positive"),
            (grid.replace("0.088", ".nan"), "non-finite"),
            (grid.replace("0.088", ".inf"), "non-finite"),
            (grid.replace("tagCols: 6", "tagCols: 100"), "587"),
            (grid.to_owned() + "low_id: 4\n", "low_id"),
            ("[camera]\nsize = [1, 2]\n".into(), "target_type"),
            (String::new(), "target_type"),
        ] {
            let said = read(&text).unwrap_err();
            assert!(said.contains(word), "{text:?}: {said}");
        }
    }
}
