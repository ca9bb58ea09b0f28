//! A loop of revolute joints in modified Denavit-Hartenberg form.

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3, Vector6};

/// Constants of one revolute joint, from the frame before it: turn by `alpha` about x, go `a` along x, turn by the joint's
/// angle about z, go `d` along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DhJoint {
    /// Twist between the axes of this joint and the one before, in radians.
    pub alpha: f64,
    /// Distance between these axes in millimetres.
    pub a: f64,
    /// Offset along this joint's axis in millimetres.
    pub d: f64,
}

impl DhJoint {
    /// The frame after this joint, at this angle in radians, in the frame before it.
    #[must_use]
    pub fn before_from_after(&self, angle: f64) -> Isometry3<f64> {
        let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        Translation3::new(self.a, 0.0, 0.0) * twist * turn * Translation3::new(0.0, 0.0, self.d)
    }
}

/// A closed chain of `N` revolute joints: the frame after the last joint is the frame before the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop<const N: usize> {
    joints: [DhJoint; N],
    /// Typical length of a link in millimetres, by which distances are compared with angles.
    scale: f64,
}

/// What is left of a loop that does not close: translation by the scale, then the rotation's matrix less the identity. The
/// skew part of that matrix alone would vanish for half a turn as well.
pub(super) type Residual = SVector<f64, 12>;

impl<const N: usize> Loop<N> {
    /// A loop of these joints. `scale` is a typical length of its links in millimetres, positive.
    #[must_use]
    pub const fn new(joints: [DhJoint; N], scale: f64) -> Self {
        Self { joints, scale }
    }

    /// The joints.
    #[must_use]
    pub const fn joints(&self) -> &[DhJoint; N] {
        &self.joints
    }

    /// A typical length of its links in millimetres.
    #[must_use]
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// The frame after joint `last` in the frame before joint `first`, going round as often as once. Indices beyond the joints
    /// begin again at the first.
    #[must_use]
    pub fn between(&self, first: usize, last: usize, angles: &[f64; N]) -> Isometry3<f64> {
        (first..=last)
            .map(|joint| joint % N)
            .fold(Isometry3::identity(), |pose, joint| pose * self.joints[joint].before_from_after(angles[joint]))
    }

    /// The frame after the last joint in the frame before the first: the identity where the loop is closed.
    #[must_use]
    pub fn closure(&self, angles: &[f64; N]) -> Isometry3<f64> {
        self.between(0, N - 1, angles)
    }

    /// How far the loop is from closed: the largest of translation by scale and entries of the rotation's matrix less the
    /// identity.
    #[must_use]
    pub fn closure_error(&self, angles: &[f64; N]) -> f64 {
        self.residual(angles).amax()
    }

    pub(super) fn residual(&self, angles: &[f64; N]) -> Residual {
        let closure = self.closure(angles);
        let rotation = closure.rotation.to_rotation_matrix().into_inner() - Matrix3::identity();
        let mut residual = Residual::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(closure.translation.vector / self.scale));
        residual.fixed_rows_mut::<9>(3).copy_from_slice(rotation.as_slice());
        residual
    }

    /// Twist of each joint in the frame before the first: its turn, and the velocity in scales that it gives to a point at the
    /// origin (K. Lynch and F. Park, *Modern Robotics*, 2017, §5.1).
    #[must_use]
    pub fn twists(&self, angles: &[f64; N]) -> SMatrix<f64, 6, N> {
        let mut pose = Isometry3::identity();
        let mut twists = SMatrix::<f64, 6, N>::zeros();
        for (index, (joint, &angle)) in self.joints.iter().zip(angles).enumerate() {
            pose *= joint.before_from_after(angle);
            let axis = pose.rotation * Vector3::z();
            let velocity = pose.translation.vector.cross(&axis) / self.scale;
            twists.set_column(index, &Vector6::new(axis.x, axis.y, axis.z, velocity.x, velocity.y, velocity.z));
        }
        twists
    }

    /// Derivative of the residual by the angles of the joints.
    pub(super) fn residual_derivative(&self, angles: &[f64; N]) -> SMatrix<f64, 12, N> {
        let closure = self.closure(angles);
        let rotation = closure.rotation.to_rotation_matrix().into_inner();
        let at = closure.translation.vector / self.scale;
        let twists = self.twists(angles);
        let mut derivative = SMatrix::<f64, 12, N>::zeros();
        for (index, twist) in twists.column_iter().enumerate() {
            let (turn, velocity) = (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned());
            derivative.fixed_view_mut::<3, 1>(0, index).copy_from(&(velocity + turn.cross(&at)));
            let turned = turn.cross_matrix() * rotation;
            derivative.fixed_view_mut::<9, 1>(3, index).copy_from_slice(turned.as_slice());
        }
        derivative
    }
}
