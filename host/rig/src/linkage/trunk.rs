//! The folding trunk of the paper's robot.

use std::f64::consts::{FRAC_PI_2, PI};

use super::{Corners, DhJoint, Loop, SixBar};

/// Lengths of the trunk's links, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkLinks {
    /// Side links, from corner to corner.
    pub side: f64,
    /// Half of an end link, from the corner to the fold.
    pub half_end: f64,
    /// Offset of the folds out of the plane of the corners.
    pub fold_offset: f64,
}

impl Default for TrunkLinks {
    /// The published model of the robot (the URDF of Origaker): sides 140 mm, end links 100 mm with a fold in the middle, folds
    /// 10 mm above the corners' plane.
    fn default() -> Self {
        Self { side: 140.0, half_end: 50.0, fold_offset: 10.0 }
    }
}

/// The joints of the trunk in the order of its loop. Corners are named as in [`SixBar`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrunkJoint {
    /// Front left corner, the paper's joint 1.
    A,
    /// Left side, joint 2.
    B,
    /// Rear left corner, joint 3.
    C,
    /// Rear fold, joint 8.
    RearFold,
    /// Rear right corner, joint 4.
    D,
    /// Right side, joint 5.
    E,
    /// Front right corner, joint 6.
    F,
    /// Front fold, joint 7.
    FrontFold,
}

impl TrunkJoint {
    /// Number of joints.
    pub const COUNT: usize = 8;
    /// The corners, from A to F.
    pub const CORNERS: [Self; 6] = [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F];
    /// The joints that the robot's five servos drive.
    pub const DRIVEN: [Self; 5] = [Self::A, Self::B, Self::C, Self::RearFold, Self::FrontFold];

    /// Its place in the loop.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Which joints of the loop are among `joints`.
    #[must_use]
    pub fn mask(joints: &[Self]) -> [bool; Self::COUNT] {
        let mut mask = [false; Self::COUNT];
        joints.iter().for_each(|joint| mask[joint.index()] = true);
        mask
    }
}

/// The trunk's loop. A joint's angle is half a turn less the interior angle of its corner; that of a fold is zero while flat.
#[must_use]
pub fn trunk(links: &TrunkLinks) -> Loop<{ TrunkJoint::COUNT }> {
    let TrunkLinks { side, half_end, fold_offset } = *links;
    let corner = |alpha, a, d| DhJoint { alpha, a, d };
    let [from_fold, between, to_fold] =
        [corner(FRAC_PI_2, half_end, -fold_offset), corner(0.0, side, 0.0), corner(0.0, side, fold_offset)];
    let fold = corner(-FRAC_PI_2, half_end, 0.0);
    Loop::new([from_fold, between, to_fold, fold, from_fold, between, to_fold, fold], 2.0 * half_end)
}

impl TrunkLinks {
    /// The planar linkage that the trunk is while both folds are flat.
    #[must_use]
    pub fn six_bar(&self) -> SixBar {
        SixBar { side: self.side, end: 2.0 * self.half_end }
    }
}

impl Corners {
    /// The shape with both sides alike and this interior angle of the side joints, in radians.
    #[must_use]
    pub fn alike(side_joint: f64) -> Self {
        let corner = PI - side_joint / 2.0;
        Self([corner, side_joint, corner, corner, side_joint, corner])
    }

    /// The angles of the trunk's joints with these corners and both folds flat.
    #[must_use]
    pub fn trunk_angles(&self) -> [f64; TrunkJoint::COUNT] {
        let mut angles = [0.0; TrunkJoint::COUNT];
        for (joint, interior) in TrunkJoint::CORNERS.into_iter().zip(self.0) {
            angles[joint.index()] = PI - interior;
        }
        angles
    }
}
