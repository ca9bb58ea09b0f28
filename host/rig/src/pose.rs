//! The pose of the rig's cameras with its covariance.

use nalgebra::{Matrix6, Vector6};
use vergence_vision::{Angle, Base, Left, Length, Right, Transform};

use crate::axis::{AxisPosition, RigAxis};
use crate::rig::Rig;
use crate::track::{JointsAt, UNIFORM};
use crate::trunk::RigTrunk;

/// The pose of the rig at one instant, with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct RigPose {
    /// The pose of the left camera in the base frame.
    pub base_from_left: Transform<Base, Left>,
    /// The pose of the right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// The position of each axis.
    pub axes: Vec<AxisPosition>,
    /// Standard deviation of the relative rotation, from encoders, their play and calibration.
    pub rotation_sigma: Angle,
    /// Standard deviation of the relative translation, from encoders and calibration.
    pub translation_sigma: Length,
    /// Covariance (6 × 6) of the relative pose, from encoders, their timing and calibration.
    ///
    /// Its components are a turn ω about the left axes in radians and a shift δ of the right camera in the left frame
    /// in millimetres. The calibration's standard deviations apply to each component.
    pub covariance: Matrix6<f64>,
}

impl RigPose {
    /// The pose of the left camera in the right frame.
    #[must_use]
    pub fn right_from_left(&self) -> Transform<Right, Left> {
        self.left_from_right.inverse()
    }
}

impl RigPose {
    /// Adds a covariance that is independent of what the pose has.
    fn add_spread(&mut self, spread: &Matrix6<f64>) {
        let part = |first: usize| spread.fixed_view::<3, 3>(first, first).trace().max(0.0).sqrt();
        self.rotation_sigma = Angle::from_rad(self.rotation_sigma.rad().hypot(part(0)));
        self.translation_sigma = Length::from_mm(self.translation_sigma.mm().hypot(part(3)));
        self.covariance += spread;
    }
}

impl Rig {
    /// The pose with the axes at exactly `values` (millimetres or radians), uncertain by the calibration alone.
    #[must_use]
    pub fn pose_at_values(&self, values: &[f64]) -> RigPose {
        let mut pose = self.calibrated(values);
        if let Some(trunk) = &self.trunk {
            // The play of its joints is larger than any reading's error, and is no part of the values.
            let exactly = vec![0.0; self.axes.len()];
            let counts = self.axes.iter().zip(values).map(|(axis, &value)| axis.counts_at(value)).collect();
            let joints = JointsAt { counts, sigma: exactly.clone(), timing: exactly };
            let spread = self.trunk_spread(trunk, &joints, &joints, &pose.left_from_right);
            pose.add_spread(&spread);
        }
        pose
    }

    /// The pose with the axes at exactly `values`, uncertain by the calibration's two numbers.
    fn calibrated(&self, values: &[f64]) -> RigPose {
        let (base_from_left, left_from_right) = self.transforms(values, values);
        let (turn, shift) = (self.calibration_sigma.0.rad().powi(2), self.calibration_sigma.1.mm().powi(2));
        RigPose {
            base_from_left,
            left_from_right,
            axes: self.positions(values),
            rotation_sigma: self.calibration_sigma.0,
            translation_sigma: self.calibration_sigma.1,
            covariance: Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift)),
        }
    }

    /// The pose with the axes at rest at `values` (millimetres or radians), uncertain by the calibration and by encoder
    /// counts.
    #[must_use]
    pub fn pose_read_at(&self, values: &[f64]) -> RigPose {
        let counts = self.axes.iter().zip(values).map(|(axis, &value)| axis.counts_at(value)).collect();
        self.pose(&JointsAt { counts, sigma: vec![UNIFORM; self.axes.len()], timing: vec![0.0; self.axes.len()] })
    }

    /// The pose at `joints`, uncertain by the calibration and, to first order, by the joints; by those of a trunk beyond it.
    #[must_use]
    pub fn pose(&self, joints: &JointsAt) -> RigPose {
        self.pose_of_each(joints, joints)
    }

    /// The pose of both cameras at two instants of one motion: the left camera with the axes at `left`, the right one
    /// at `right`.
    ///
    /// The errors of the readings count as common to both instants.
    #[must_use]
    pub fn pose_of_each(&self, left: &JointsAt, right: &JointsAt) -> RigPose {
        let values = [left, right].map(|joints| self.values(joints));
        let exact = self.transforms(&values[0], &values[1]);
        let mut pose = self.calibrated(&values[0]);
        (pose.base_from_left, pose.left_from_right) = exact;
        let corners: &[usize] = self.trunk.as_ref().map_or(&[], |trunk| &trunk.axes[..3]);
        // First the errors of each axis by itself, then that of the instant, which moves all axes together.
        let alone = (0..self.axes.len()).filter(|index| !corners.contains(index)).map(|index| {
            [left, right].map(|joints| {
                let of_reading = joints.sigma.get(index).copied().unwrap_or(0.0);
                let sigma =
                    |(i, axis): (usize, &RigAxis)| if i == index { axis.sigma_with_play(of_reading) } else { 0.0 };
                self.axes.iter().enumerate().map(sigma).collect::<Vec<f64>>()
            })
        });
        let together = [left, right].map(|joints| joints.timing.clone());
        let (mut rotation, mut translation) = (pose.rotation_sigma.rad(), pose.translation_sigma.mm());
        for counts in alone.chain([together]) {
            let moved = [0, 1].map(|side| {
                let steps = self.axes.iter().zip(&counts[side]).map(|(axis, counts)| counts * axis.value_per_count());
                values[side].iter().zip(steps).map(|(value, step)| value + step).collect::<Vec<f64>>()
            });
            let after = self.transforms(&moved[0], &moved[1]).1;
            let change = exact.1.inverse() * after;
            rotation = rotation.hypot(change.rotation().angle());
            translation = translation.hypot(change.origin().mm().norm());
            let twist = difference(&exact.1, &after);
            pose.covariance += twist * twist.transpose();
        }
        pose.rotation_sigma = Angle::from_rad(rotation);
        pose.translation_sigma = Length::from_mm(translation);
        if let Some(trunk) = &self.trunk {
            let spread = self.trunk_spread(trunk, left, right, &exact.1);
            pose.add_spread(&spread);
        }
        pose
    }

    fn values(&self, joints: &JointsAt) -> Vec<f64> {
        self.axes.iter().zip(&joints.counts).map(|(axis, &counts)| axis.value_at(counts)).collect()
    }

    fn positions(&self, values: &[f64]) -> Vec<AxisPosition> {
        self.axes.iter().zip(values).map(|(axis, &value)| AxisPosition::from_value(axis.kind, value)).collect()
    }

    /// `base_from_left` with the axes at `left`, and `left_from_right` with the right camera's axes at `right`.
    fn transforms(&self, left: &[f64], right: &[f64]) -> (Transform<Base, Left>, Transform<Left, Right>) {
        let (base_from_left, base_from_right) = match &self.trunk {
            Some(trunk) => trunk.cameras_at(left, right),
            None => (self.left_chain.base_from_camera(left), self.right_chain.base_from_camera(right)),
        };
        (base_from_left, base_from_left.inverse() * base_from_right)
    }

    /// Mean square of the way from the `stated` relative pose to the true one by errors of a trunk's corners.
    ///
    /// Near a dead centre the pose is no linear function of them, and leaves the stated one to one side only. So it is taken by
    /// Gauss-Hermite quadrature with three nodes for each driven corner, and around the stated pose, not around the mean.
    fn trunk_spread(
        &self,
        trunk: &RigTrunk,
        left: &JointsAt,
        right: &JointsAt,
        stated: &Transform<Left, Right>,
    ) -> Matrix6<f64> {
        const NODES: [(f64, f64); 3] =
            [(0.0, 2.0 / 3.0), (1.732_050_807_568_877_2, 1.0 / 6.0), (-1.732_050_807_568_877_2, 1.0 / 6.0)];
        let values = [left, right].map(|joints| self.values(joints));
        // A passive joint with play turns the loop as an error of a driven one does.
        let passive = 0.5 * trunk.passive_play;
        let sigma = |corner: usize| {
            let axis = trunk.axes[corner];
            let reading = left.sigma.get(axis).copied().unwrap_or(0.0);
            let driven = self.axes.get(axis).map_or(0.0, |axis| axis.sigma_with_play(reading) * axis.value_per_count());
            driven.hypot(passive)
        };
        let sigmas = [0, 1, 2].map(sigma);
        let mut spread = Matrix6::zeros();
        for number in 0..27 {
            let nodes = [number / 9, number / 3 % 3, number % 3].map(|node: usize| NODES[node]);
            let mut moved = values.clone();
            for ((&axis, sigma), (node, _)) in trunk.axes.iter().zip(sigmas).zip(nodes) {
                moved.iter_mut().filter_map(|values| values.get_mut(axis)).for_each(|value| *value += node * sigma);
            }
            let twist = difference(stated, &self.transforms(&moved[0], &moved[1]).1);
            spread += twist * twist.transpose() * nodes.iter().map(|(_, weight)| weight).product::<f64>();
        }
        spread
    }
}

/// The turn ω and the shift δ from one pose to another.
fn difference(from: &Transform<Left, Right>, to: &Transform<Left, Right>) -> Vector6<f64> {
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    let shift = to.origin().mm() - from.origin().mm();
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}
