//! Prediction of the uncertainty of depth, before anything moves.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{Angle, Base, Left, Length, PlacedCamera, Point, PointUncertainty, StereoPair, Transform};

use crate::pose::RigPose;
use crate::rig::Rig;

/// The predicted uncertainty of points around a rig in one pose, from pixel noise, calibration and encoders.
#[derive(Clone, Debug)]
pub struct DepthField<'a> {
    rig: &'a Rig,
    pose: RigPose,
    pixel_sigma: f64,
}

/// The predicted uncertainty of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedDepth {
    /// The point in the left frame.
    pub point: Point<Left>,
    /// Covariance of the point in mm², along the axes of the base frame.
    pub covariance: Matrix3<f64>,
    /// Standard deviation of its forward coordinate.
    pub sigma_forward: Length,
    /// Standard deviation of its distance from the middle of both cameras.
    pub sigma_range: Length,
}

impl<'a> DepthField<'a> {
    /// Prepares the prediction for the axes at rest at `values` (millimetres or radians), and matches with a standard
    /// deviation of `pixel_sigma` pixels in each coordinate of each image.
    #[must_use]
    pub fn new(rig: &'a Rig, values: &[f64], pixel_sigma: f64) -> Self {
        Self::of_pose(rig, rig.pose_read_at(values), pixel_sigma)
    }

    /// The same for cameras in `pose`, with its covariance.
    #[must_use]
    pub fn of_pose(rig: &'a Rig, pose: RigPose, pixel_sigma: f64) -> Self {
        Self { rig, pose, pixel_sigma }
    }

    /// The pose of the prediction.
    #[must_use]
    pub const fn pose(&self) -> &RigPose {
        &self.pose
    }

    /// Both cameras with their poses in the base frame.
    #[must_use]
    pub fn cameras(&self) -> [PlacedCamera<'a>; 2] {
        let (left, right) = (self.pose.base_from_left, self.pose.base_from_left * self.pose.left_from_right);
        [
            PlacedCamera { lens: &self.rig.left_camera, base_from_camera: left.renamed(), body: None },
            PlacedCamera { lens: &self.rig.right_camera, base_from_camera: right.renamed(), body: None },
        ]
    }

    /// The middle between both optical centres, in the base frame.
    #[must_use]
    pub fn middle(&self) -> Point<Base> {
        let [left, right] = self.cameras().map(|camera| camera.base_from_camera.origin().mm());
        Point::from_mm((left + right) / 2.0)
    }

    /// Predicts the uncertainty of the point at `range` from the middle of both cameras, at `azimuth` to the right and
    /// `elevation` upwards.
    ///
    /// `None` where not both cameras see the point, and on the baseline.
    #[must_use]
    pub fn at(&self, azimuth: Angle, elevation: Angle, range: Length) -> Option<PredictedDepth> {
        let (az, el) = (azimuth.rad(), elevation.rad());
        let direction = Vector3::new(az.sin() * el.cos(), -el.sin(), az.cos() * el.cos());
        let in_base = Point::<Base>::from_mm(self.middle().mm() + direction * range.mm());
        if !self.cameras().iter().all(|camera| camera.sees(&in_base)) {
            return None;
        }
        let left_from_base: Transform<Left, Base> = self.pose.base_from_left.inverse();
        let point = left_from_base * in_base;
        let pair = StereoPair {
            left: &self.rig.left_camera,
            right: &self.rig.right_camera,
            left_from_right: self.pose.left_from_right,
        };
        let in_left = PointUncertainty::of(&point, &pair, self.pixel_sigma)?.covariance(&self.pose.shared);
        let turn = self.pose.base_from_left.rotation().to_rotation_matrix();
        let covariance = turn * in_left * turn.transpose();
        let along = |axis: Vector3<f64>| Length::from_mm((axis.dot(&(covariance * axis))).max(0.0).sqrt());
        Some(PredictedDepth { point, covariance, sigma_forward: along(Vector3::z()), sigma_range: along(direction) })
    }
}
