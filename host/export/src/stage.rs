//! Where the axes and the cameras were at each exposure, as a table.

use std::fmt::Write as _;

use nalgebra::Isometry3;
use vergence_rig::{AxisPosition, Rig, RigAxis, RigPose};

/// Metres in a millimetre.
const MM: f64 = 1e-3;

/// The table `mav0/stage0/data.csv`.
pub struct Stage(String);

impl Stage {
    /// What the columns mean, for `mav0/stage0/sensor.yaml`.
    pub const ABOUT: &str = "sensor_type: stage\n\
        comment: \"Axes and pose of the cameras at each exposure. timestamp names the images of both cameras; timestamp_left and timestamp_right are the \
        middles of their exposures. counts are those of the encoder from its zero, between two readings a fraction. p_LR and q_LR are the right camera in \
        the frame of the left one, p_BL and q_BL the left camera in the frame of the base: metres, unit quaternions. The frame of a camera has x right, y \
        down, z forward. sigma_rotation and sigma_translation are standard deviations of the pose LR.\"\n";

    /// An empty table.
    pub fn new(axes: &[RigAxis]) -> Self {
        let mut head = "#timestamp [ns],timestamp_left [ns],timestamp_right [ns]".to_owned();
        // Writing to a text does not fail.
        for axis in axes {
            let unit = if matches!(axis.range[0], AxisPosition::Linear(_)) { "m" } else { "rad" };
            _ = write!(head, ",{0} [counts],{0} [{unit}]", axis.name);
        }
        for pose in ["LR", "BL"] {
            for part in ["x", "y", "z"] {
                _ = write!(head, ",p_{pose}_{part} [m]");
            }
            for part in ["w", "x", "y", "z"] {
                _ = write!(head, ",q_{pose}_{part} []");
            }
        }
        Self(head + ",sigma_rotation [rad],sigma_translation [m]\n")
    }

    /// Appends a line: the time that names the images, the times of both, and the pose at them.
    pub fn note(&mut self, times: [u64; 3], rig: &Rig, pose: &RigPose) {
        let axes = rig.axes.iter().zip(&pose.axes).flat_map(|(axis, &at)| [axis.counts_at(at.value()), si(at)]);
        let poses = [pose.left_from_right.isometry(), pose.base_from_left.isometry()];
        let sigmas = [pose.rotation_sigma.rad(), pose.translation_sigma.mm() * MM];
        let times = times.map(|time| time.to_string()).join(",");
        // Digits of a number are as many as it takes to read the same number.
        let numbers: String =
            axes.chain(poses.into_iter().flat_map(numbers)).chain(sigmas).map(|value| format!(",{value}")).collect();
        self.0 += &(times + &numbers + "\n");
    }

    /// The whole table.
    pub fn csv(&self) -> &str {
        &self.0
    }
}

fn si(position: AxisPosition) -> f64 {
    match position {
        AxisPosition::Linear(length) => length.mm() * MM,
        AxisPosition::Rotary(angle) => angle.rad(),
    }
}

/// x, y and z in metres, then w, x, y and z of the quaternion, of which w is not negative.
fn numbers(pose: &Isometry3<f64>) -> [f64; 7] {
    let p = pose.translation.vector * MM;
    let sign = if pose.rotation.w < 0.0 { -1.0 } else { 1.0 };
    let q = pose.rotation.into_inner() * sign;
    [p.x, p.y, p.z, q.w, q.i, q.j, q.k]
}
