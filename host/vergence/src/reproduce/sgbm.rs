//! OpenCV's semi-global matching beside ours, where a Python with OpenCV is there.

use std::path::Path;

use serde_json::{Value, json};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{KannalaBrandt, Length, Pixel};

use crate::python::ask_python;

/// Needs only OpenCV and numpy.
const SCRIPT: &str = include_str!("sgbm.py");
/// Half the field of the rectified view, and its size in pixels: about as fine as the fisheye image.
const HALF_FIELD_DEG: f64 = 45.0;
const SIZE: u32 = 552;
/// No point is looked for nearer than this.
const NEAREST_MM: f64 = 250.0;

/// What semi-global matching came to.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct Sgbm {
    /// Of OpenCV.
    pub version: String,
    /// Share of the rectified view's pixels that have a disparity.
    pub covered: f64,
    /// How many these are.
    pub pixels: usize,
    /// Of some of them: u and v in the left image, and the range in millimetres.
    points: Vec<[f64; 3]>,
}

impl Sgbm {
    /// Left pixels and ranges of some points.
    pub fn points(&self) -> impl Iterator<Item = (Pixel, Length)> {
        self.points.iter().map(|&[u, v, range]| (Pixel { u, v }, Length::from_mm(range)))
    }
}

/// Rectifies the images in the files `left` and `right` and matches them; draws its disparities to `picture`. Says in words
/// why it cannot.
pub fn sgbm(python: &str, [left, right, picture]: [&Path; 3], rig: &Rig, pose: &RigPose) -> Result<Sgbm, String> {
    let rotation = pose.left_from_right.rotation().to_rotation_matrix().into_inner();
    let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| rotation[(row, column)]));
    let task = json!({
        "left": left,
        "right": right,
        "picture": picture,
        "left_lens": lens(&rig.left_camera),
        "right_lens": lens(&rig.right_camera),
        "left_from_right": rows,
        "centre_mm": <[f64; 3]>::from(pose.left_from_right.origin().mm()),
        "half_field_deg": HALF_FIELD_DEG,
        "size": SIZE,
        "nearest_mm": NEAREST_MM,
    });
    ask_python(python, SCRIPT, [task.to_string()])
}

fn lens(camera: &KannalaBrandt) -> Value {
    let lens = camera.to_opencv();
    json!({
        "fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy, "k": lens.k,
        "theta_max_deg": camera.theta_max().deg(),
    })
}
