//! Which way is forward.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use vergence_vision::{Left, Right, Transform};

/// The rig's own directions in the left frame, millimetres.
pub struct Axes {
    /// Of the baseline.
    pub middle: Vector3<f64>,
    /// Along the baseline.
    pub right: Vector3<f64>,
    /// Across both others.
    pub down: Vector3<f64>,
    /// Between the optical axes, across the baseline.
    pub forward: Vector3<f64>,
}

impl Axes {
    /// Of cameras that stand so.
    #[must_use]
    pub fn of(left_from_right: &Transform<Left, Right>) -> Self {
        let centre = left_from_right.origin().mm();
        let right = centre.normalize();
        let between = Vector3::z() + left_from_right.rotation() * Vector3::z();
        let forward = (between - right * between.dot(&right)).normalize();
        Self { middle: centre / 2.0, right, down: forward.cross(&right), forward }
    }

    /// Turns the rig's x, y and z into them.
    #[must_use]
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let axes = Matrix3::from_columns(&[self.right, self.down, self.forward]);
        UnitQuaternion::from_matrix(&axes)
    }
}
