//! A shape of the folding trunk: its corners, and how far it is folded.

use std::f64::consts::PI;

use super::{Corners, TrunkJoint};

/// A closed shape of the trunk.
///
/// With flat folds the corners are those of a planar six-bar. Folded, both folds have the same angle and both sides are alike: the loop
/// closes in no other shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkShape {
    /// Interior angles of the corners.
    pub corners: Corners,
    /// Interior angle of both folds in radians: half a turn where they are flat, zero where one half of the trunk lies on the other.
    pub fold: f64,
}

impl TrunkShape {
    /// The shape with these corners and flat folds.
    #[must_use]
    pub const fn flat(corners: Corners) -> Self {
        Self { corners, fold: PI }
    }

    /// The shape with both sides alike, this interior angle of the side joints, and this one of the folds, in radians.
    #[must_use]
    pub fn alike(side_joint: f64, fold: f64) -> Self {
        Self { corners: Corners::alike(side_joint), fold }
    }

    /// Whether both folds are flat.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        (self.fold - PI).abs() < SAME
    }

    /// The interior angle of the side joints where both sides are alike; `None` of another shape.
    #[must_use]
    pub fn side_joint_alike(&self) -> Option<f64> {
        let side_joint = self.corners.0[1];
        let alike = Corners::alike(side_joint);
        let differs = alike.0.iter().zip(self.corners.0).any(|(one, other)| (one - other).abs() > SAME);
        (!differs).then_some(side_joint)
    }

    /// The angles of the trunk's joints.
    #[must_use]
    pub fn trunk_angles(&self) -> [f64; TrunkJoint::COUNT] {
        let mut angles = self.corners.trunk_angles();
        for fold in [TrunkJoint::RearFold, TrunkJoint::FrontFold] {
            angles[fold.index()] = PI - self.fold;
        }
        angles
    }
}

/// Angles that differ by less than this, in radians, are the same.
const SAME: f64 = 1e-9;
