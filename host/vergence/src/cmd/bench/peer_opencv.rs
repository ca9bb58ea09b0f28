//! OpenCV's fisheye model on the same rays.

use std::process::Command;

use serde_json::{Value, json};
use vergence_vision::{Angle, OpenCvFisheye};

/// Needs only OpenCV and numpy.
const SCRIPT: &str = include_str!("opencv_fisheye.py");

/// OpenCV's nanoseconds per point.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct PeerTimes {
    pub project_ns: f64,
    pub unproject_ns: f64,
    pub version: String,
}

impl PeerTimes {
    /// The better of two measurements.
    pub fn least(self, other: &Self) -> Self {
        Self {
            project_ns: self.project_ns.min(other.project_ns),
            unproject_ns: self.unproject_ns.min(other.unproject_ns),
            version: self.version,
        }
    }

    pub fn json(&self) -> Value {
        json!({ "project_ns": self.project_ns, "unproject_ns": self.unproject_ns, "version": self.version })
    }
}

/// Runs OpenCV in `python`; says in words why it cannot.
pub fn opencv(
    python: &str,
    points: u32,
    repeats: u32,
    lens: &OpenCvFisheye,
    field: Angle,
) -> Result<PeerTimes, String> {
    let numbers = [lens.fx, lens.fy, lens.cx, lens.cy].into_iter().chain(lens.k).chain([field.deg()]);
    let output = Command::new(python)
        .args(["-c", SCRIPT, &points.to_string(), &repeats.to_string()])
        .args(numbers.map(|number| number.to_string()))
        .output()
        .map_err(|error| format!("{python} does not start: {error}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(said.lines().last().unwrap_or("it fails without a word").to_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|error| format!("its answer is not understood: {error}"))
}
