//! OpenCV's semi-global matching on the pair that the other matchers get: the task for Python and its answer.

use image::RgbImage;
use serde_json::{Value, json};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{KannalaBrandt, Length, Pixel};

/// Script that rectifies and matches a pair; it needs only OpenCV and numpy.
const SCRIPT: &str = include_str!("sgbm.py");
/// Half the field of the rectified view, and its size in pixels: about as fine as the fisheye image.
const HALF_FIELD_DEG: f64 = 45.0;
const SIZE: u32 = 552;
/// Nearest point that is looked for, from the left camera.
const NEAREST_MM: f64 = 250.0;

/// A pair for semi-global matching.
#[derive(Clone, Debug)]
pub struct SgbmTask<'a> {
    /// The mode of the rig.
    pub mode: &'static str,
    /// The Python script.
    pub script: &'static str,
    /// The left and the right image.
    pub images: [&'a RgbImage; 2],
    /// The argument of the script, without `left`, `right` and `picture`: the files of both images, and of the picture that
    /// it draws.
    pub argument: Value,
}

/// The script's answer.
#[derive(Clone, Debug)]
pub struct SgbmAnswer {
    /// What it printed.
    pub figures: Value,
    /// The picture that it drew: disparities beside the left image.
    pub picture: RgbImage,
}

/// Points of semi-global matching.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct Sgbm {
    /// OpenCV's version.
    pub version: String,
    /// Part of the rectified view's pixels that have a disparity.
    pub covered: f64,
    /// Pixels that have a disparity.
    pub pixels: usize,
    /// A sample of them: u and v in the left image, and the range in millimetres.
    points: Vec<[f64; 3]>,
}

impl Sgbm {
    /// Reads what the script printed.
    pub fn read(figures: Value) -> Result<Self, String> {
        serde_json::from_value(figures).map_err(|error| format!("the answer of OpenCV is not understood: {error}"))
    }

    /// Left pixels and ranges of a sample of points.
    pub fn points(&self) -> impl Iterator<Item = (Pixel, Length)> {
        self.points.iter().map(|&[u, v, range]| (Pixel { u, v }, Length::from_mm(range)))
    }
}

impl<'a> SgbmTask<'a> {
    /// The task for the `images` that `rig` takes at `pose`.
    pub fn new(mode: &'static str, images: [&'a RgbImage; 2], rig: &Rig, pose: &RigPose) -> Self {
        let rotation = pose.left_from_right.rotation().to_rotation_matrix().into_inner();
        let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| rotation[(row, column)]));
        let argument = json!({
            "left_lens": lens(&rig.left_camera),
            "right_lens": lens(&rig.right_camera),
            "left_from_right": rows,
            "centre_mm": <[f64; 3]>::from(pose.left_from_right.origin().mm()),
            "half_field_deg": HALF_FIELD_DEG,
            "size": SIZE,
            "nearest_mm": NEAREST_MM,
        });
        Self { mode, script: SCRIPT, images, argument }
    }
}

fn lens(camera: &KannalaBrandt) -> Value {
    let lens = camera.to_opencv();
    json!({
        "fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy, "k": lens.k,
        "theta_max_deg": camera.theta_max().deg(),
    })
}
