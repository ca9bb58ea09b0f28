//! The sets of real data, and where they are.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use vergence_vision::ImageSize;

use crate::error::BenchError;

/// The fisheye sets with corners: folder and corner file.
pub const CORNER_SETS: [(&str, &str); 4] = [
    ("sourishg_stereo", "corners_opencv_classic.csv"),
    ("ocam_fisheye1", "corners_opencv_classic.csv"),
    ("ov_plane", "corners_babelcalib_train.csv"),
    ("ov_plane", "corners_babelcalib_test.csv"),
];

/// The sets with images of a plain chessboard: folder and pattern of the image files.
pub const IMAGE_SETS: [(&str, &str); 2] = [("sourishg_stereo", "images/*.jpg"), ("ocam_fisheye1", "images/*.jpg")];

/// The file `meta.json` of a set.
#[derive(Debug, Deserialize)]
pub struct Meta {
    size: [u32; 2],
    /// Columns and rows of inner corners.
    pub board_inner_corners: [u32; 2],
    /// Side of a square, in millimetres.
    pub square_mm: f64,
    /// Names of the cameras in the corner files.
    pub cameras: Vec<String>,
}

impl Meta {
    /// Size of the images, in pixels.
    #[must_use]
    pub fn size(&self) -> ImageSize {
        ImageSize { width: self.size[0], height: self.size[1] }
    }
}

/// The folder with the data and the scripts of the peers; without a name, `../shared`.
///
/// # Errors
/// Where it has no folder `data`.
pub fn shared(named: Option<&Path>) -> Result<PathBuf, BenchError> {
    let folder = named.map_or_else(|| PathBuf::from("../shared"), Path::to_path_buf);
    if folder.join("data").is_dir() {
        return Ok(folder);
    }
    Err(BenchError::NoData(folder))
}

/// Reads `meta.json` in the folder `set`.
///
/// # Errors
/// Where it cannot be read or is not understood.
pub fn meta(set: &Path) -> Result<Meta, BenchError> {
    let path = set.join("meta.json");
    let text = std::fs::read_to_string(&path).map_err(|error| BenchError::read(&path, error))?;
    serde_json::from_str(&text).map_err(|error| BenchError::read(&path, error))
}
