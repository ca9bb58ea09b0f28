//! The numbers of a trunk that a calibration finds, in one order for steps and covariances.

use nalgebra::SMatrix;

use super::TRUNK_AXES;
use crate::linkage::{CameraMount, TrunkCameras, TrunkLinks};

/// Number of the parameters of a trunk.
pub const TRUNK_PARAMETERS: usize = 20;

/// Covariance of the parameters in the order of [`TrunkParameters::to_array`], in radians and millimetres.
pub type TrunkCovariance = SMatrix<f64, TRUNK_PARAMETERS, TRUNK_PARAMETERS>;

/// The parameters of a trunk: what its drawing states and a calibration corrects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkParameters {
    /// What is added to the positions of the driven joints, in the order of [`TrunkJoint::DRIVEN`](crate::linkage::TrunkJoint), in
    /// radians. Zero where the axes' own zeros are right.
    pub zeros: [f64; TRUNK_AXES],
    /// Lengths of the links.
    pub links: TrunkLinks,
    /// Places of the cameras.
    pub cameras: TrunkCameras,
}

/// Kinds of parameters, by which a drawing states how exact it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrunkParameterKind {
    /// Zero of a joint's encoder, in radians.
    JointZero,
    /// Length of a link, in millimetres.
    Length,
    /// Place of a camera on its link, in millimetres.
    MountPosition,
    /// Angle of a camera on its link, in radians.
    MountAngle,
}

impl TrunkParameterKind {
    /// Whether its values are angles in radians; otherwise they are lengths in millimetres.
    #[must_use]
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::JointZero | Self::MountAngle)
    }
}

/// Names of the parameters in their order, as reports print them, and their kinds.
pub const TRUNK_PARAMETER_NAMES: [(&str, TrunkParameterKind); TRUNK_PARAMETERS] = {
    use TrunkParameterKind::{JointZero, Length, MountAngle, MountPosition};
    [
        ("zero of the front corner", JointZero),
        ("zero of the side joint", JointZero),
        ("zero of the rear corner", JointZero),
        ("zero of the rear fold", JointZero),
        ("zero of the front fold", JointZero),
        ("side link", Length),
        ("half end link", Length),
        ("fold offset", Length),
        ("left mount, along the link", MountPosition),
        ("left mount, outward", MountPosition),
        ("left mount, height", MountPosition),
        ("left mount, angle", MountAngle),
        ("left mount, tilt", MountAngle),
        ("left mount, roll", MountAngle),
        ("right mount, along the link", MountPosition),
        ("right mount, outward", MountPosition),
        ("right mount, height", MountPosition),
        ("right mount, angle", MountAngle),
        ("right mount, tilt", MountAngle),
        ("right mount, roll", MountAngle),
    ]
};

impl TrunkParameters {
    /// The parameters as numbers in radians and millimetres, in the order of [`TRUNK_PARAMETER_NAMES`].
    #[must_use]
    pub const fn to_array(&self) -> [f64; TRUNK_PARAMETERS] {
        let [a, b, c, rear, front] = self.zeros;
        let TrunkLinks { side, half_end, fold_offset } = self.links;
        let (left, right) = (self.cameras.left, self.cameras.right);
        [
            a,
            b,
            c,
            rear,
            front,
            side,
            half_end,
            fold_offset,
            left.along,
            left.outward,
            left.height,
            left.angle,
            left.tilt,
            left.roll,
            right.along,
            right.outward,
            right.height,
            right.angle,
            right.tilt,
            right.roll,
        ]
    }

    /// The parameters with these numbers: the inverse of [`Self::to_array`].
    #[must_use]
    pub const fn from_array(numbers: &[f64; TRUNK_PARAMETERS]) -> Self {
        let [a, b, c, rear, front, side, half_end, fold_offset, ..] = *numbers;
        Self {
            zeros: [a, b, c, rear, front],
            links: TrunkLinks { side, half_end, fold_offset },
            cameras: TrunkCameras { side, left: mount_at(numbers, 8), right: mount_at(numbers, 14) },
        }
    }
}

const fn mount_at(numbers: &[f64; TRUNK_PARAMETERS], first: usize) -> CameraMount {
    CameraMount {
        along: numbers[first],
        outward: numbers[first + 1],
        height: numbers[first + 2],
        angle: numbers[first + 3],
        tilt: numbers[first + 4],
        roll: numbers[first + 5],
    }
}

/// How far a trunk may be from its drawing: one standard deviation of each kind of parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkTolerance {
    /// Of the zero of a joint's encoder, in radians.
    pub joint_zero: f64,
    /// Of the length of a link, in millimetres.
    pub length: f64,
    /// Of a camera's place on its link along each axis, in millimetres.
    pub mount_position: f64,
    /// Of a camera's direction about each axis, in radians.
    pub mount_angle: f64,
}

impl Default for TrunkTolerance {
    /// Assumed for a robot assembled by hand, its servos set against a square: 0.5 degrees, 0.5 mm, 3 mm, 2 degrees.
    fn default() -> Self {
        Self { joint_zero: 0.5_f64.to_radians(), length: 0.5, mount_position: 3.0, mount_angle: 2_f64.to_radians() }
    }
}

impl TrunkTolerance {
    /// The standard deviation of a parameter of this kind, in radians or millimetres.
    #[must_use]
    pub const fn of(&self, kind: TrunkParameterKind) -> f64 {
        match kind {
            TrunkParameterKind::JointZero => self.joint_zero,
            TrunkParameterKind::Length => self.length,
            TrunkParameterKind::MountPosition => self.mount_position,
            TrunkParameterKind::MountAngle => self.mount_angle,
        }
    }
}
