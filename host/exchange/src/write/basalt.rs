//! Basalt's calibration, kb4. The frame that Basalt calls the IMU's is that of the left camera; of an IMU there is nothing to say, and its
//! figures are zero.

use nalgebra::Isometry3;
use serde_json::{Value, json};
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::Cameras;
use crate::pose::METRE;

pub fn write(cameras: &Cameras) -> String {
    let right = cameras.right.as_ref();
    let lenses: Vec<_> = [Some(&cameras.left), right.map(|(lens, _)| lens)].into_iter().flatten().collect();
    let poses = [Some(Isometry3::identity()), right.map(|(_, pose)| *pose.isometry())].into_iter().flatten();
    let size = |lens: &&KannalaBrandt| {
        let ImageSize { width, height } = lens.size();
        json!([width, height])
    };
    let value = json!({
        "T_imu_cam": poses.map(|pose| place(&pose)).collect::<Vec<_>>(),
        "intrinsics": lenses.iter().map(|lens| intrinsics(lens)).collect::<Vec<_>>(),
        "resolution": lenses.iter().map(size).collect::<Vec<_>>(),
        "vignette": [],
        "calib_accel_bias": vec![0.0; 9],
        "calib_gyro_bias": vec![0.0; 12],
        "imu_update_rate": 0.0,
        "accel_noise_std": vec![0.0; 3],
        "gyro_noise_std": vec![0.0; 3],
        "accel_bias_std": vec![0.0; 3],
        "gyro_bias_std": vec![0.0; 3],
        "cam_time_offset_ns": 0,
    });
    format!("{:#}\n", json!({ "value0": value }))
}

fn place(pose: &Isometry3<f64>) -> Value {
    let (metres, turn) = (pose.translation.vector / METRE, pose.rotation.quaternion());
    json!({"px": metres.x, "py": metres.y, "pz": metres.z, "qx": turn.i, "qy": turn.j, "qz": turn.k, "qw": turn.w})
}

fn intrinsics(lens: &KannalaBrandt) -> Value {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = lens.to_opencv();
    let values = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "k1": k1, "k2": k2, "k3": k3, "k4": k4});
    json!({"camera_type": "kb4", "intrinsics": values})
}
