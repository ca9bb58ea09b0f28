//! OpenCV's fisheye model on the same rays.

use serde_json::{Value, json};
use vergence_vision::{Angle, OpenCvFisheye};

use crate::python::ask_python;

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
    let arguments = [points.to_string(), repeats.to_string()];
    ask_python(python, SCRIPT, arguments.into_iter().chain(numbers.map(|number| number.to_string())))
}
