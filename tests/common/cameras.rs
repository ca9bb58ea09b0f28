//! Calibrated cameras to work with.

use std::path::Path;

use super::run_json;

/// The camera files of both cameras of the stereo set, from its corners.
pub fn camera_files(folder: &Path, work: &Path) -> [String; 2] {
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    ["left", "right"].map(|side| {
        let out = work.join(format!("{side}.toml")).to_string_lossy().into_owned();
        let from = ["--csv", &csv, "--camera", side, "--size", "960x600"];
        run_json(&[&["calibrate", "intrinsics", "--json", "--out", &out], &from[..]].concat());
        out
    })
}
