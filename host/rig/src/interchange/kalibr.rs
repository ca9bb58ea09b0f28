//! Kalibr's camchain YAML of one camera or a pair. Its translations are in metres, and `T_cn_cnm1` is
//! `right_from_left`.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use vergence_vision::{ImageSize, KannalaBrandt, Left, OpenCvFisheye, Right, Transform};

use super::{Camchain, InterchangeError, camera, parse};

#[derive(Deserialize)]
struct File {
    cam0: Camera,
    cam1: Option<Camera>,
}

#[derive(Deserialize)]
struct Camera {
    camera_model: String,
    distortion_model: String,
    distortion_coeffs: [f64; 4],
    intrinsics: [f64; 4],
    resolution: [u32; 2],
    #[serde(rename = "T_cn_cnm1")]
    from_previous: Option<[[f64; 4]; 4]>,
    theta_max_deg: Option<f64>,
}

impl Camera {
    fn read(&self) -> Result<KannalaBrandt, InterchangeError> {
        if self.camera_model != "pinhole" || self.distortion_model != "equidistant" {
            return Err(InterchangeError::Model(format!("{}-{}", self.camera_model, self.distortion_model)));
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        let [width, height] = self.resolution;
        let lens = OpenCvFisheye { fx, fy, cx, cy, k: self.distortion_coeffs };
        camera(lens, ImageSize { width, height }, self.theta_max_deg)
    }
}

/// Parses a Kalibr camchain of one or two cameras.
///
/// # Errors
/// [`InterchangeError`] names the missing key or what is wrong.
pub fn read(text: &str) -> Result<Camchain, InterchangeError> {
    let file: File = parse(text)?;
    let right = match &file.cam1 {
        None => None,
        Some(right) => {
            let rows = right.from_previous.ok_or_else(|| InterchangeError::Missing("cam1 has no T_cn_cnm1".into()))?;
            Some((right.read()?, left_from_right(&rows)?))
        }
    };
    Ok(Camchain { left: file.cam0.read()?, right })
}

fn left_from_right(rows: &[[f64; 4]; 4]) -> Result<Transform<Left, Right>, InterchangeError> {
    let [x, y, z, _] = rows;
    let matrix = Matrix3::from_rows(&[x, y, z].map(|row| Vector3::new(row[0], row[1], row[2]).transpose()));
    let not_rigid = (matrix * matrix.transpose() - Matrix3::identity()).norm() > 1e-6 || matrix.determinant() < 0.0;
    if not_rigid || rows.iter().flatten().any(|number| !number.is_finite()) {
        return Err(InterchangeError::Missing("T_cn_cnm1 is not a rigid transform".into()));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    let metres = Vector3::new(x[3], y[3], z[3]);
    Ok(Transform::<Right, Left>::new(rotation, metres * 1000.0).inverse())
}

/// Prints a Kalibr camchain.
#[must_use]
pub fn write(chain: &Camchain) -> String {
    let mut text = format!("cam0:\n{}", camera_keys(&chain.left));
    if let Some((right, left_from_right)) = &chain.right {
        let matrix = left_from_right.inverse().isometry().to_homogeneous();
        text += "cam1:\n  T_cn_cnm1:\n";
        for row in 0..4 {
            // Millimetres to metres in the translation.
            let metres = if row < 3 { matrix[(row, 3)] / 1000.0 } else { 1.0 };
            text +=
                &format!("  - [{:?}, {:?}, {:?}, {metres:?}]\n", matrix[(row, 0)], matrix[(row, 1)], matrix[(row, 2)]);
        }
        text += &camera_keys(right);
    }
    text
}

fn camera_keys(camera: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k } = camera.to_opencv();
    let ImageSize { width, height } = camera.size();
    format!(
        "  camera_model: pinhole\n  distortion_model: equidistant\n  distortion_coeffs: {k:?}\n  \
         intrinsics: [{fx:?}, {fy:?}, {cx:?}, {cy:?}]\n  resolution: [{width}, {height}]\n  theta_max_deg: {:?}\n",
        camera.theta_max().deg()
    )
}
