//! How well a stage returns to a pose.

use nalgebra::Matrix6;
use vergence_vision::{Angle, Length};

/// How far the right camera comes to stand beside where the axes put it, differently at each return: a carriage that tilts, a mount that
/// gives. One standard deviation of each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeatability {
    /// Of the rotation about each axis.
    pub rotation: Angle,
    /// Of the position along each axis.
    pub translation: Length,
}

impl Repeatability {
    /// The covariance (6 × 6) of the relative pose by it, in the coordinates of [`crate::RigPose::covariance`].
    #[must_use]
    pub fn covariance(&self) -> Matrix6<f64> {
        of_components(self.rotation, self.translation)
    }
}

/// The covariance of a pose whose components have these standard deviations, each by itself.
pub(crate) fn of_components(rotation: Angle, translation: Length) -> Matrix6<f64> {
    let (turn, shift) = (rotation.rad().powi(2), translation.mm().powi(2));
    Matrix6::from_diagonal(&[turn, turn, turn, shift, shift, shift].into())
}
