//! The sets of real data, and where they are.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use vergence_vision::ImageSize;

use crate::failure::Failure;

/// The fisheye sets with corners: folder and corner file.
pub const CORNER_SETS: [(&str, &str); 4] = [
    ("sourishg_stereo", "corners_opencv_classic.csv"),
    ("ocam_fisheye1", "corners_opencv_classic.csv"),
    ("ov_plane", "corners_babelcalib_train.csv"),
    ("ov_plane", "corners_babelcalib_test.csv"),
];

/// Those with images of a plain chessboard: folder and images.
pub const IMAGE_SETS: [(&str, &str); 2] = [("sourishg_stereo", "images/*.jpg"), ("ocam_fisheye1", "images/*.jpg")];

/// What a set says of itself.
#[derive(Debug, Deserialize)]
pub struct Meta {
    size: [u32; 2],
    /// Columns and rows.
    pub board_inner_corners: [u32; 2],
    pub square_mm: f64,
    /// What the corner files call the cameras.
    pub cameras: Vec<String>,
}

impl Meta {
    pub fn size(&self) -> ImageSize {
        ImageSize { width: self.size[0], height: self.size[1] }
    }
}

/// The folder with data and peers: as named, or as the environment says, or beside the source tree.
///
/// # Errors
/// Where there is none.
pub fn shared(named: Option<&Path>) -> Result<PathBuf, Failure> {
    let folder = named.map_or_else(|| PathBuf::from("../shared"), Path::to_path_buf);
    if folder.join("data").is_dir() {
        return Ok(folder);
    }
    Err(Failure::usage(format!(
        "{}: no calibration data there; name the folder that has it with --shared or VERGENCE_SHARED",
        folder.display()
    )))
}

/// Reads `meta.json` of a set.
///
/// # Errors
/// Says which file and why.
pub fn meta(set: &Path) -> Result<Meta, Failure> {
    let path = set.join("meta.json");
    let text = std::fs::read_to_string(&path).map_err(|error| Failure::input(&path, error))?;
    serde_json::from_str(&text).map_err(|error| Failure::input(&path, error))
}
