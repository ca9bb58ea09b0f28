//! A `camera_info` of ROS for each camera, equidistant. Rectification and projection say where the cameras are: both are turned to axes of
//! which x runs from the left camera to the right one, and the right one stands beside by the baseline.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{ImageSize, KannalaBrandt, Left, OpenCvFisheye, Right, Transform};

use super::{Cameras, WrittenFile, each};
use crate::pose::METRE;

pub fn write(cameras: &Cameras) -> Vec<WrittenFile> {
    let (turns, baseline) = cameras.right.as_ref().map_or(([Matrix3::identity(); 2], 0.0), |(_, pose)| rectified(pose));
    let name = |index: usize| match (&cameras.right, index) {
        (None, _) => "camera",
        (_, 0) => "left",
        _ => "right",
    };
    each(cameras, |index, lens| camera(lens, name(index), &turns[index], baseline * index as f64))
}

/// What turns the frames of both cameras to the common axes, and the baseline in metres. z of these axes looks where both cameras look in the
/// mean, as far as that is across the baseline.
fn rectified(left_from_right: &Transform<Left, Right>) -> ([Matrix3<f64>; 2], f64) {
    let (origin, turn) = (left_from_right.origin().mm(), *left_from_right.rotation().to_rotation_matrix().matrix());
    let along = origin / origin.norm();
    let ahead = Vector3::z() + turn * Vector3::z();
    let across = along.cross(&Vector3::y());
    let z = [ahead - along * ahead.dot(&along), across, Vector3::z()].into_iter().find(|z| z.norm() > 1e-6);
    let z = z.unwrap_or(across).normalize();
    let rectified_from_left = Matrix3::from_columns(&[along, z.cross(&along), z]).transpose();
    ([rectified_from_left, rectified_from_left * turn], origin.norm() / METRE)
}

fn camera(lens: &KannalaBrandt, name: &str, turn: &Matrix3<f64>, baseline: f64) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k } = lens.to_opencv();
    let ImageSize { width, height } = lens.size();
    let matrix = |key: &str, rows: usize, data: &[f64]| {
        format!("{key}:\n  rows: {rows}\n  cols: {}\n  data: {data:?}\n", data.len() / rows)
    };
    format!("image_width: {width}\nimage_height: {height}\ncamera_name: {name}\ndistortion_model: equidistant\n")
        + &matrix("camera_matrix", 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
        + &matrix("distortion_coefficients", 1, &k)
        + &matrix("rectification_matrix", 3, turn.transpose().as_slice())
        + &matrix("projection_matrix", 3, &[fx, 0.0, cx, -fx * baseline, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
}
