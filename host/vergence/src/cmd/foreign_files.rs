//! Files for other programs, which `camera convert` and `rig export` write.

use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_exchange::{Cameras, WriteFormat};
use vergence_files::write_whole;

use crate::console::Console;
use crate::failure::Failure;

/// A format that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CameraFormat {
    /// This program's own.
    Toml,
    /// FileStorage YAML, cv::fisheye.
    Opencv,
    /// Camchain, pinhole-equidistant.
    Kalibr,
    /// Calibration JSON, kb4.
    Basalt,
    /// A camera_info for each camera, equidistant.
    Ros,
    /// cameras.txt, OPENCV_FISHEYE.
    Colmap,
    /// A cameramodel for each camera, splined stereographic.
    Mrcal,
}

impl CameraFormat {
    /// The other program's format; `None` for ours.
    pub fn foreign(self) -> Option<WriteFormat> {
        Some(match self {
            Self::Toml => return None,
            Self::Opencv => WriteFormat::OpenCv,
            Self::Kalibr => WriteFormat::Kalibr,
            Self::Basalt => WriteFormat::Basalt,
            Self::Ros => WriteFormat::Ros,
            Self::Colmap => WriteFormat::Colmap,
            Self::Mrcal => WriteFormat::Mrcal,
        })
    }
}

/// Writes cameras to `out`, or to a file beside it for each camera where the format wants that, and says what the format cannot hold.
///
/// # Errors
/// A lens that the format cannot hold, or a file that cannot be written.
pub fn write(format: WriteFormat, cameras: &Cameras, out: &Path, console: Console) -> Result<(), Failure> {
    let written = vergence_exchange::write(format, cameras).map_err(|error| Failure::usage(error.to_string()))?;
    for remark in &written.remarks {
        console.warn(remark);
    }
    let mut paths = Vec::new();
    for file in &written.files {
        let path = file.side.map_or_else(|| out.to_owned(), |side| beside(out, side));
        write_whole(&path, file.text.as_bytes())?;
        console.say(format!("wrote {}", path.display()))?;
        paths.push(path);
    }
    console.result(&json!({ "out": paths, "remarks": written.remarks }))
}

/// `calib.yaml` as `calib-left.yaml`.
fn beside(out: &Path, side: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let ending = out.extension().map(|ending| format!(".{}", ending.to_string_lossy())).unwrap_or_default();
    out.with_file_name(format!("{stem}-{side}{ending}"))
}
