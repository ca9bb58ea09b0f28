//! OpenCV and SciPy on the same calibrations and images, run by the scripts beside the data.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::error::BenchError;
use crate::python::ask_python;

/// Script that times OpenCV's detectors of chessboards; it needs only OpenCV and numpy.
const DETECTORS: &str = include_str!("opencv_detect.py");

/// The fit of one peer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeerFit {
    /// Seconds it took; `None` where it failed.
    pub seconds: Option<f64>,
    /// Root mean square of the residuals over all corners, in pixels.
    pub rms_px: Option<f64>,
    /// Why it failed.
    pub error: Option<String>,
}

/// The peers' fits of one camera of a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeerCalibration {
    /// `cv2.fisheye.calibrate`, given its crude guess.
    pub opencv: PeerFit,
    /// SciPy's bundle adjustment: the least-squares optimum.
    pub scipy: PeerFit,
}

/// What one of OpenCV's detectors found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct Detector {
    /// Images in which it found the board.
    pub boards: usize,
    /// Median of the milliseconds for an image.
    pub median_ms: f64,
}

/// OpenCV's detectors on the same images, one thread.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct OpenCvDetectors {
    /// `findChessboardCorners`, refined by `cornerSubPix`.
    pub classic: Detector,
    /// `findChessboardCornersSB` with `CALIB_CB_NORMALIZE_IMAGE` alone.
    pub sb: Detector,
    /// The same with `CALIB_CB_EXHAUSTIVE` and `CALIB_CB_ACCURACY`.
    pub sb_thorough: Detector,
}

/// The peers on this machine.
#[derive(Clone, Debug)]
pub struct Peer<'a> {
    /// The Python interpreter that has OpenCV and SciPy.
    pub python: &'a str,
    /// The folder of the script `peer_calib.py`.
    pub scripts: PathBuf,
    /// Times each calibration is solved.
    pub runs: u16,
}

impl Peer<'_> {
    /// Calibrates every camera of `set` by the peers, in the order of `cameras`.
    ///
    /// # Errors
    /// Where Python, OpenCV, SciPy or the script is missing.
    pub fn calibrate(&self, set: &Path, corners: &str, cameras: &[String]) -> Result<Vec<PeerCalibration>, BenchError> {
        // The script writes a reference of its own; the stored ones stay as they are.
        let folder = tempfile::tempdir().map_err(BenchError::temporary)?;
        let runs = self.runs.to_string();
        let arguments: [&OsStr; 7] = [
            set.as_os_str(),
            "--corners".as_ref(),
            corners.as_ref(),
            "--runs".as_ref(),
            runs.as_ref(),
            "--out".as_ref(),
            folder.path().as_os_str(),
        ];
        let said = self.run("peer_calib.py", &arguments)?;
        let result: Value = said
            .lines()
            .last()
            .and_then(|line| serde_json::from_str(line).ok())
            .ok_or_else(|| BenchError::Peer("the answer of peer_calib.py is not JSON".into()))?;
        let of = |camera: &String| {
            let mono = &result["mono"][camera];
            PeerCalibration {
                opencv: fit(&mono["cv_fisheye_with_guess"], "median_s"),
                scipy: fit(&mono["kb4_scipy_ba"], "seconds"),
            }
        };
        Ok(cameras.iter().map(of).collect())
    }

    /// Runs OpenCV's detectors on `images` of a chessboard with so many columns and rows of inner corners.
    ///
    /// # Errors
    /// Where Python or OpenCV is missing.
    pub fn detect(&self, images: &[PathBuf], [columns, rows]: [u32; 2]) -> Result<OpenCvDetectors, BenchError> {
        let paths = images.iter().map(|path| path.to_string_lossy().into_owned());
        ask_python(self.python, DETECTORS, [columns.to_string(), rows.to_string()].into_iter().chain(paths))
            .map_err(BenchError::Peer)
    }

    fn run(&self, script: &str, arguments: &[&OsStr]) -> Result<String, BenchError> {
        let path = self.scripts.join(script);
        let output = Command::new(self.python)
            .arg(&path)
            .args(arguments)
            .output()
            .map_err(|error| BenchError::Peer(format!("{} does not start ({error})", self.python)))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
        Err(BenchError::Peer(format!("{} failed: {last}", path.display())))
    }
}

fn fit(of: &Value, seconds: &str) -> PeerFit {
    let error = of["error"].as_str().map(str::to_owned);
    PeerFit { seconds: of[seconds].as_f64(), rms_px: of["rms_px"].as_f64(), error }
}
