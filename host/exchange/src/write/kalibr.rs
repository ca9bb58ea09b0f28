//! Kalibr's camchain, pinhole-equidistant, with the key `theta_max_deg` that Kalibr ignores.

use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::Cameras;
use crate::pose::METRE;

pub fn write(cameras: &Cameras) -> String {
    let mut text = format!("cam0:\n{}", keys(&cameras.left));
    if let Some((right, left_from_right)) = &cameras.right {
        let matrix = left_from_right.inverse().isometry().to_homogeneous();
        text += "cam1:\n  T_cn_cnm1:\n";
        for row in 0..4 {
            let metres = if row < 3 { matrix[(row, 3)] / METRE } else { 1.0 };
            text +=
                &format!("  - [{:?}, {:?}, {:?}, {metres:?}]\n", matrix[(row, 0)], matrix[(row, 1)], matrix[(row, 2)]);
        }
        text += &keys(right);
    }
    text
}

fn keys(lens: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k } = lens.to_opencv();
    let ImageSize { width, height } = lens.size();
    format!(
        "  camera_model: pinhole\n  distortion_model: equidistant\n  distortion_coeffs: {k:?}\n  \
         intrinsics: [{fx:?}, {fy:?}, {cx:?}, {cy:?}]\n  resolution: [{width}, {height}]\n  theta_max_deg: {:?}\n",
        lens.theta_max().deg()
    )
}
