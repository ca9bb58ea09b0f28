//! The pose of the rig's cameras with its covariance.

mod trunk;

use nalgebra::{Matrix3, Matrix6, Vector6};
use vergence_vision::{Angle, Base, Left, Length, Right, SharedCovariance, Transform};

use crate::axis::{AxisPosition, RigAxis};
use crate::rig::Rig;
use crate::track::{JointsAt, UNIFORM};
use crate::trunk::{OpenLoop, TrunkClosure};

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
    /// Covariance of both lenses and of the relative pose, which all points of a pair share: from calibration, encoders and their
    /// timing.
    pub shared: SharedCovariance,
    /// Whether that has the calibration's part: a rig file may say nothing of it.
    pub is_calibration_known: bool,
    /// How the readings fit the closed loop of a trunk; `None` of a rig without one.
    pub closure: Option<TrunkClosure>,
}

impl RigPose {
    /// The pose of the left camera in the right frame.
    #[must_use]
    pub fn right_from_left(&self) -> Transform<Right, Left> {
        self.left_from_right.inverse()
    }

    /// Refuses the pose of a trunk whose loop does not close as its joints read, by more than their noise.
    ///
    /// # Errors
    /// [`OpenLoop`], which names the readings most likely wrong.
    pub fn check_closure(&self) -> Result<(), OpenLoop> {
        self.closure.as_ref().map_or(Ok(()), TrunkClosure::check)
    }

    /// Covariance (6 × 6) of the relative pose: a turn ω about the left axes in radians and a shift δ of the right camera in the left
    /// frame in millimetres.
    #[must_use]
    pub fn covariance(&self) -> Matrix6<f64> {
        self.shared.pose()
    }

    /// Adds a covariance that is independent of what the pose has.
    fn add_spread(&mut self, spread: &Matrix6<f64>) {
        let part = |first: usize| spread.fixed_view::<3, 3>(first, first).trace().max(0.0).sqrt();
        self.rotation_sigma = Angle::from_rad(self.rotation_sigma.rad().hypot(part(0)));
        self.translation_sigma = Length::from_mm(self.translation_sigma.mm().hypot(part(3)));
        self.shared = self.shared.plus_pose(spread);
    }
}

impl Rig {
    /// The pose with the axes at exactly `values` (millimetres or radians), uncertain by the calibration and by how well the rig returns;
    /// of a trunk by the play of its joints as well, which is larger than any reading's error.
    #[must_use]
    pub fn pose_at_values(&self, values: &[f64]) -> RigPose {
        if self.trunk.is_none() {
            let mut pose = self.calibrated(values, values, &self.calibration_covariance(values, values));
            self.add_return(&mut pose);
            return pose;
        }
        let exactly = vec![0.0; self.axes.len()];
        let counts = self.axes.iter().zip(values).map(|(axis, &value)| axis.counts_at(value)).collect();
        self.pose(&JointsAt { counts, sigma: exactly.clone(), timing: exactly })
    }

    /// Adds how far the right camera returns beside where the axes put it.
    fn add_return(&self, pose: &mut RigPose) {
        if let Some(repeatability) = self.repeatability {
            pose.add_spread(&repeatability.covariance());
        }
    }

    /// The pose with the axes of the left and of the right camera at exactly these values, uncertain by the calibration; that of a
    /// trunk's numbers is added with its joints.
    fn calibrated(&self, left: &[f64], right: &[f64], calibration: &SharedCovariance) -> RigPose {
        let (base_from_left, left_from_right) = self.transforms(left, right);
        let mut shared = *calibration;
        if self.calibrated_trunk().is_some() {
            shared = shared.with_pose(&Matrix6::zeros());
        }
        let covariance = shared.pose();
        let worst = |first: usize| {
            let part: Matrix3<f64> = covariance.fixed_view::<3, 3>(first, first).into_owned();
            part.symmetric_eigenvalues().max().max(0.0).sqrt()
        };
        RigPose {
            base_from_left,
            left_from_right,
            axes: self.positions(left),
            rotation_sigma: Angle::from_rad(worst(0)),
            translation_sigma: Length::from_mm(worst(3)),
            shared,
            is_calibration_known: self.calibration.is_known() || self.calibrated_trunk().is_some(),
            closure: None,
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
        self.pose_of_rows(left, right, &self.calibration_at(left, right))
    }

    /// What the calibration leaves uncertain with the left camera's axes at `left` and the right one's at `right`.
    pub(crate) fn calibration_at(&self, left: &JointsAt, right: &JointsAt) -> SharedCovariance {
        self.calibration_covariance(&self.values(left), &self.values(right))
    }

    /// [`Self::pose_of_each`], with the `calibration` part as given: it hardly changes from one row of an image to the next.
    pub(crate) fn pose_of_rows(&self, left: &JointsAt, right: &JointsAt, calibration: &SharedCovariance) -> RigPose {
        let values = [left, right].map(|joints| self.values(joints));
        let exact = self.transforms(&values[0], &values[1]);
        let mut pose = self.calibrated(&values[0], &values[1], calibration);
        // Of a trunk the corners are no part of this, and none of its joints once it is calibrated.
        let corners: &[usize] = match (self.calibrated_trunk(), &self.trunk) {
            (Some((trunk, _)), _) => &trunk.axes,
            (None, Some(trunk)) => &trunk.axes[..3],
            (None, None) => &[],
        };
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
        let mut by_joints = Matrix6::zeros();
        for counts in alone.chain([together]) {
            let moved = [0, 1].map(|side| {
                let steps = self.axes.iter().zip(&counts[side]).map(|(axis, counts)| {
                    // The sign matters where all axes move together.
                    counts * axis.direction() * axis.value_per_count()
                });
                values[side].iter().zip(steps).map(|(value, step)| value + step).collect::<Vec<f64>>()
            });
            let after = self.transforms(&moved[0], &moved[1]).1;
            let change = exact.1.inverse() * after;
            rotation = rotation.hypot(change.rotation().angle());
            translation = translation.hypot(change.origin().mm().norm());
            let twist = difference(&exact.1, &after);
            by_joints += twist * twist.transpose();
        }
        pose.shared = pose.shared.plus_pose(&by_joints);
        pose.rotation_sigma = Angle::from_rad(rotation);
        pose.translation_sigma = Length::from_mm(translation);
        self.add_return(&mut pose);
        if let Some(trunk) = &self.trunk {
            let spread = self.trunk_spread(trunk, left, right, &exact.1);
            pose.add_spread(&spread);
            let [at_left, at_right] = [left, right].map(|joints| self.closure(trunk, joints));
            pose.closure = Some(if at_right.missed > at_left.missed { at_right } else { at_left });
        }
        pose
    }

    /// Standard deviation of the relative rotation at `pose` by its joints alone. That of a calibrated trunk has the part of its
    /// numbers, which cannot be told apart from play.
    #[must_use]
    pub fn rotation_sigma_of_joints(&self, pose: &RigPose) -> Angle {
        let values: Vec<f64> = pose.axes.iter().map(|axis| axis.value()).collect();
        let calibration = self.calibrated(&values, &values, &self.calibration_covariance(&values, &values));
        let (all, calibrated) = (pose.rotation_sigma.rad(), calibration.rotation_sigma.rad());
        Angle::from_rad((all.powi(2) - calibrated.powi(2)).max(0.0).sqrt())
    }

    /// The part of the covariance of `pose` that is the calibration's: its errors are the same each time that the axes stand there.
    #[must_use]
    pub fn lasting_covariance(&self, pose: &RigPose) -> Matrix6<f64> {
        let values: Vec<f64> = pose.axes.iter().map(|axis| axis.value()).collect();
        let of_trunk = self.trunk_calibration_covariance(&values);
        of_trunk.unwrap_or_else(|| self.calibration_covariance(&values, &values).pose())
    }

    /// How the relative pose changes where the axis `index` is `counts` further than `joints` say: a turn ω and a shift δ as in
    /// [`RigPose::covariance`], to first order.
    #[must_use]
    pub fn pose_change(&self, joints: &JointsAt, index: usize, counts: f64) -> Vector6<f64> {
        let off = |by: f64| {
            let mut moved = joints.clone();
            moved.counts.iter_mut().skip(index).take(1).for_each(|at| *at += by);
            let values = self.values(&moved);
            self.transforms(&values, &values).1
        };
        let exact = off(0.0);
        (difference(&exact, &off(counts)) - difference(&exact, &off(-counts))) / 2.0
    }

    /// The poses of the left camera in the base frame and of the right one in the left frame with the axes at exactly `values` (millimetres
    /// or radians), as in [`Self::pose_at_values`], and not how uncertain they are, which takes longer.
    #[must_use]
    pub fn cameras_at_values(&self, values: &[f64]) -> (Transform<Base, Left>, Transform<Left, Right>) {
        self.transforms(values, values)
    }

    fn values(&self, joints: &JointsAt) -> Vec<f64> {
        self.axes.iter().zip(&joints.counts).map(|(axis, &counts)| axis.value_at(counts)).collect()
    }

    fn positions(&self, values: &[f64]) -> Vec<AxisPosition> {
        self.axes.iter().zip(values).map(|(axis, &value)| AxisPosition::from_value(axis.kind, value)).collect()
    }

    /// `base_from_left` with the axes at `left`, and `left_from_right` with the right camera's axes at `right`.
    pub(crate) fn transforms(&self, left: &[f64], right: &[f64]) -> (Transform<Base, Left>, Transform<Left, Right>) {
        let (base_from_left, base_from_right) = match &self.trunk {
            Some(trunk) => trunk.cameras_at(left, right),
            None => (self.left_chain.base_from_camera(left), self.right_chain.base_from_camera(right)),
        };
        (base_from_left, base_from_left.inverse() * base_from_right)
    }
}

/// The turn ω and the shift δ from one pose to another.
pub(crate) fn difference(from: &Transform<Left, Right>, to: &Transform<Left, Right>) -> Vector6<f64> {
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    let shift = to.origin().mm() - from.origin().mm();
    Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}
