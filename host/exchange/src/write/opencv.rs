//! OpenCV's FileStorage YAML, of `cv::fisheye`. It says its model, its unit, and up to which angle the polynomial is good.

use nalgebra::Matrix3;
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::Cameras;

pub fn write(cameras: &Cameras) -> String {
    let ImageSize { width, height } = cameras.left.size();
    let head = format!("%YAML:1.0\n---\nmodel: fisheye\nimage_width: {width}\nimage_height: {height}\n");
    let Some((right, left_from_right)) = &cameras.right else {
        return head + &camera(&cameras.left, ["camera_matrix", "distortion_coefficients", "theta_max_deg"]);
    };
    let right_from_left = left_from_right.inverse();
    let turn: Matrix3<f64> = *right_from_left.rotation().to_rotation_matrix().matrix();
    let shift = right_from_left.origin().mm();
    head + &camera(&cameras.left, ["K1", "D1", "theta_max_deg1"])
        + &camera(right, ["K2", "D2", "theta_max_deg2"])
        + "translation_unit: mm\n"
        + &matrix("R", [3, 3], turn.transpose().as_slice())
        + &matrix("T", [3, 1], shift.as_slice())
}

fn camera(lens: &KannalaBrandt, [k_key, d_key, limit_key]: [&str; 3]) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k } = lens.to_opencv();
    let limit = format!("{limit_key}: {:?}\n", lens.theta_max().deg());
    limit + &matrix(k_key, [3, 3], &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]) + &matrix(d_key, [4, 1], &k)
}

fn matrix(key: &str, [rows, columns]: [usize; 2], data: &[f64]) -> String {
    format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data:?}\n")
}
