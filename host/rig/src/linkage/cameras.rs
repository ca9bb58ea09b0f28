//! The cameras on the trunk: on the two front side links, from corner A towards B and from corner F towards E.

use nalgebra::{Isometry3, Matrix3, Rotation3, SMatrix, Translation3, UnitQuaternion, Vector3};
use vergence_vision::{Left, Right, Transform};

use super::{Loop, NotDriven, TrunkJoint, TrunkLinks};

const JOINTS: usize = TrunkJoint::COUNT;

/// Where one camera sits on its link, seen from outside: the same numbers on both sides are mirror images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMount {
    /// Distance from the front corner along the link, in millimetres.
    pub along: f64,
    /// Distance outward from the link, in millimetres.
    pub outward: f64,
    /// Height above the plane of the corners, in millimetres.
    pub height: f64,
    /// Angle of the optical axis from the link's front end outward, in radians.
    pub angle: f64,
    /// Angle by which the camera then looks up, about its own x axis, in radians.
    pub tilt: f64,
    /// Angle by which the camera is then turned about its optical axis, x towards y, in radians.
    pub roll: f64,
}

impl Default for CameraMount {
    /// 60 degrees outward, inferred from the published separations of the modes; 50 mm along the link and 25 mm outward, in the
    /// corners' plane and upright, assumed.
    fn default() -> Self {
        Self { along: 50.0, outward: 25.0, height: 0.0, angle: 60_f64.to_radians(), tilt: 0.0, roll: 0.0 }
    }
}

impl CameraMount {
    /// A camera at `at`, in the frame of its link, whose axis lies in the corners' plane along `axis` before it is tilted and rolled,
    /// and whose lower side then is that of the trunk (-z of the link).
    fn placed(&self, at: Vector3<f64>, axis: Vector3<f64>) -> Isometry3<f64> {
        let down = -Vector3::z();
        let columns = Matrix3::from_columns(&[down.cross(&axis), down, axis]);
        let level = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(columns));
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.tilt);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.roll);
        Isometry3::from_parts(Translation3::from(at), level * tilt * roll)
    }
}

/// Where both cameras sit on their links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkCameras {
    /// Length of the side links in millimetres.
    pub side: f64,
    /// The left camera, on link AB.
    pub left: CameraMount,
    /// The right camera, on link FE.
    pub right: CameraMount,
}

impl Default for TrunkCameras {
    fn default() -> Self {
        Self::alike(TrunkLinks::default().side, CameraMount::default())
    }
}

impl TrunkCameras {
    /// Both cameras mounted as mirror images, on side links of this length in millimetres.
    #[must_use]
    pub const fn alike(side: f64, mount: CameraMount) -> Self {
        Self { side, left: mount, right: mount }
    }

    /// The left camera in the frame of its link: x from corner A to B, z up, so that -y is outward.
    pub(crate) fn link_from_left(&self) -> Isometry3<f64> {
        let CameraMount { along, outward, height, angle, .. } = self.left;
        self.left.placed(Vector3::new(along, -outward, height), Vector3::new(-angle.cos(), -angle.sin(), 0.0))
    }

    /// The right camera in the frame of its link: x from corner E to F.
    pub(crate) fn link_from_right(&self) -> Isometry3<f64> {
        let CameraMount { along, outward, height, angle, .. } = self.right;
        let at = Vector3::new(self.side - along, -outward, height);
        self.right.placed(at, Vector3::new(angle.cos(), -angle.sin(), 0.0))
    }

    /// Pose of the right camera in the left one's frame, with the trunk's joints at `angles` in radians.
    #[must_use]
    pub fn left_from_right(&self, trunk: &Loop<JOINTS>, angles: &[f64; JOINTS]) -> Transform<Left, Right> {
        let right_link_from_left_link = trunk.between(TrunkJoint::F.index(), JOINTS + TrunkJoint::A.index(), angles);
        let right_from_left = self.link_from_right().inverse() * right_link_from_left_link * self.link_from_left();
        Transform::from_isometry(right_from_left.inverse())
    }

    /// Pose of the left camera in the frame before joint A, that of the left half of the front end link.
    #[must_use]
    pub fn front_from_left(&self, trunk: &Loop<JOINTS>, angles: &[f64; JOINTS]) -> Isometry3<f64> {
        trunk.between(TrunkJoint::A.index(), TrunkJoint::A.index(), angles) * self.link_from_left()
    }

    /// Motion of the right camera in the left one's frame for each radian of a driven joint: turn in radians, shift of its centre in
    /// millimetres. Columns of joints that are not driven are zero.
    ///
    /// # Errors
    /// [`NotDriven`] at a singular shape, where the passive joints do not follow the driven ones.
    pub fn sensitivity(
        &self,
        trunk: &Loop<JOINTS>,
        angles: &[f64; JOINTS],
        driven: &[bool; JOINTS],
    ) -> Result<SMatrix<f64, 6, JOINTS>, NotDriven> {
        let following = trunk.following(angles, driven)?;
        let mut slopes = SMatrix::<f64, 6, JOINTS>::zeros();
        let right = self.left_from_right(trunk, angles).isometry().translation.vector;
        let right_link_from_left =
            trunk.between(TrunkJoint::F.index(), JOINTS + TrunkJoint::A.index(), angles) * self.link_from_left();
        let mut frame = Isometry3::identity();
        // The joints between the links, from right to left: each turns the right camera backwards about its axis.
        for joint in [TrunkJoint::F, TrunkJoint::FrontFold, TrunkJoint::A].map(TrunkJoint::index) {
            frame *= trunk.joints()[joint].before_from_after(angles[joint]);
            let left_from_frame = right_link_from_left.inverse() * frame;
            let axis = left_from_frame.rotation * -Vector3::z();
            let shift = axis.cross(&(right - left_from_frame.translation.vector));
            let turned = SMatrix::<f64, 6, 1>::from_iterator(axis.iter().chain(shift.iter()).copied());
            slopes += turned * following.row(joint);
        }
        Ok(slopes)
    }
}
