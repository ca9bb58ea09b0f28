//! Where the cameras were at an exposure.

use vergence_vision::{Angle, Base, Left, Length, Right, Transform};

use crate::axis::AxisPosition;
use crate::rig::Rig;
use crate::track::JointsAt;

/// The pose of the rig at one instant, with what is uncertain about it.
#[derive(Clone, Debug, PartialEq)]
pub struct RigPose {
    /// The left camera in the base frame.
    pub base_from_left: Transform<Base, Left>,
    /// The right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// Where each axis was.
    pub axes: Vec<AxisPosition>,
    /// Standard deviation of the relative rotation, from encoders and calibration.
    pub rotation_sigma: Angle,
    /// Standard deviation of the relative translation, from encoders and calibration.
    pub translation_sigma: Length,
}

impl RigPose {
    /// The left camera in the right frame.
    #[must_use]
    pub fn right_from_left(&self) -> Transform<Right, Left> {
        self.left_from_right.inverse()
    }
}

impl Rig {
    /// The pose with the axes at exactly `values` (millimetres or radians), as far as the calibration knows it.
    #[must_use]
    pub fn pose_at_values(&self, values: &[f64]) -> RigPose {
        let (base_from_left, left_from_right) = self.transforms(values);
        let axes =
            self.axes.iter().zip(values).map(|(axis, &value)| AxisPosition::from_value(axis.kind, value)).collect();
        RigPose {
            base_from_left,
            left_from_right,
            axes,
            rotation_sigma: self.calibration_sigma.0,
            translation_sigma: self.calibration_sigma.1,
        }
    }

    /// The pose at `joints`, with the encoders' share of the uncertainty to first order.
    #[must_use]
    pub fn pose(&self, joints: &JointsAt) -> RigPose {
        let values: Vec<f64> = self.axes.iter().zip(&joints.counts).map(|(axis, &c)| axis.value_at(c)).collect();
        let mut pose = self.pose_at_values(&values);
        let (mut rotation, mut translation) = (pose.rotation_sigma.rad(), pose.translation_sigma.mm());
        for (index, (axis, sigma)) in self.axes.iter().zip(&joints.sigma).enumerate() {
            let mut moved = values.clone();
            if let Some(value) = moved.get_mut(index) {
                *value += sigma * axis.value_per_count();
            }
            let change = pose.right_from_left() * self.transforms(&moved).1;
            rotation = rotation.hypot(change.rotation().angle());
            translation = translation.hypot(change.origin().mm().norm());
        }
        pose.rotation_sigma = Angle::from_rad(rotation);
        pose.translation_sigma = Length::from_mm(translation);
        pose
    }

    fn transforms(&self, values: &[f64]) -> (Transform<Base, Left>, Transform<Left, Right>) {
        let base_from_left = self.left_chain.base_from_camera(values);
        (base_from_left, base_from_left.inverse() * self.right_chain.base_from_camera(values))
    }
}
