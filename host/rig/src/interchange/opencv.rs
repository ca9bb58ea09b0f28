//! OpenCV's FileStorage YAML of one fisheye camera.

use serde::Deserialize;
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::{InterchangeError, camera, parse};

#[derive(Deserialize)]
struct Matrix {
    data: Vec<f64>,
}

/// The keys that OpenCV's own samples and common tools write; others are ignored.
#[derive(Deserialize)]
struct File {
    #[serde(alias = "K", alias = "cameraMatrix", alias = "M1")]
    camera_matrix: Option<Matrix>,
    #[serde(alias = "D", alias = "dist_coeffs", alias = "distCoeffs", alias = "D1")]
    distortion_coefficients: Option<Matrix>,
    image_width: Option<u32>,
    image_height: Option<u32>,
    #[serde(alias = "image_size")]
    resolution: Option<Matrix>,
    theta_max_deg: Option<f64>,
}

/// Parses an OpenCV fisheye camera file.
///
/// # Errors
/// [`InterchangeError`] names the missing key or what is wrong.
pub fn read(text: &str) -> Result<KannalaBrandt, InterchangeError> {
    let missing = |what: &str| InterchangeError::Missing(what.to_owned());
    let file: File = parse(text)?;
    let matrix = file.camera_matrix.ok_or_else(|| missing("camera_matrix (or K) is missing"))?.data;
    let [fx, skew, cx, _, fy, cy, ..] = matrix[..] else { return Err(missing("camera_matrix must have nine numbers")) };
    if skew.abs() > 1e-6 * fx.abs() {
        return Err(InterchangeError::Model(format!("the camera has a skew of {skew}")));
    }
    let distortion =
        file.distortion_coefficients.ok_or_else(|| missing("distortion_coefficients (or D) is missing"))?;
    let k = <[f64; 4]>::try_from(distortion.data).map_err(|data| {
        InterchangeError::Model(format!("{} distortion coefficients; a fisheye camera has 4", data.len()))
    })?;
    let size = match (file.image_width, file.image_height, file.resolution.as_ref().map(|m| &m.data[..])) {
        (Some(width), Some(height), _) => ImageSize { width, height },
        (_, _, Some(&[width, height])) => ImageSize { width: width as u32, height: height as u32 },
        _ => return Err(missing("image_width and image_height (or resolution) are missing")),
    };
    camera(OpenCvFisheye { fx, fy, cx, cy, k }, size, file.theta_max_deg)
}

/// Prints an OpenCV fisheye camera file.
#[must_use]
pub fn write(camera: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = camera.to_opencv();
    let ImageSize { width, height } = camera.size();
    format!(
        "%YAML:1.0\n---\nmodel: fisheye\nimage_width: {width}\nimage_height: {height}\ntheta_max_deg: {:?}\n\
         camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
         data: [ {fx:?}, 0., {cx:?}, 0., {fy:?}, {cy:?}, 0., 0., 1. ]\n\
         distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   \
         data: [ {k1:?}, {k2:?}, {k3:?}, {k4:?} ]\n",
        camera.theta_max().deg()
    )
}
