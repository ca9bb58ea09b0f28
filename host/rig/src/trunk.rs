//! A rig whose cameras ride on a folding trunk in place of stages.

use std::f64::consts::PI;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vergence_vision::{Base, Left, Right, Transform};

use crate::linkage::{
    CornerLimits, Corners, FlatTrunk, Loop, NoPath, TrunkBodies, TrunkCameras, TrunkJoint, TrunkLinks, TrunkPath,
    WantedClearance, trunk,
};

/// Number of axes of a trunk: its driven joints.
pub const TRUNK_AXES: usize = 5;
/// Folds that are nearer to flat than this, in radians, count as flat: two degrees. The trunk then is a planar linkage.
const FLAT: f64 = 0.035;

/// The trunk of a rig: five driven joints and three that follow.
///
/// Positions of the axes are interior angles of the corners and of the folds, half a turn where a joint is straight or flat. The
/// base frame stands on the left half of the front link, with its origin at the front fold: x to the right along the link, y down, z
/// forward.
#[derive(Clone, Debug, PartialEq)]
pub struct RigTrunk {
    /// Lengths of its links.
    pub links: TrunkLinks,
    /// Places of the cameras.
    pub cameras: TrunkCameras,
    /// Sizes of its bodies.
    pub bodies: TrunkBodies,
    /// Limits of its corners.
    pub limits: CornerLimits,
    /// Play of each passive joint in radians: the true angle is up to half of it to either side.
    pub passive_play: f64,
    /// Index of the axis of each of [`TrunkJoint::DRIVEN`].
    pub axes: [usize; TRUNK_AXES],
}

impl RigTrunk {
    /// The angles of the joints of the loop with the axes at `values` in radians.
    ///
    /// With flat folds corner E is outward. Angles for which the loop does not close, by play or noise at a dead centre, give the
    /// shape with D, E and F in line. A folded trunk has both sides alike: no other shape of it closes.
    fn angles(&self, values: &[f64]) -> [f64; TrunkJoint::COUNT] {
        let value = |joint: usize| self.axes.get(joint).and_then(|&axis| values.get(axis)).copied().unwrap_or(PI);
        let [a, b, c, rear, front] = std::array::from_fn(value);
        let shape = if (rear - PI).abs() < FLAT && (front - PI).abs() < FLAT {
            self.links.six_bar().outward_or_straight([a, b, c])
        } else {
            Corners([a, b, c, c, b, a])
        };
        let mut angles = shape.trunk_angles();
        angles[TrunkJoint::RearFold.index()] = PI - rear;
        angles[TrunkJoint::FrontFold.index()] = PI - front;
        angles
    }

    /// The shape with the axes at `values` in radians.
    #[must_use]
    pub fn shape(&self, values: &[f64]) -> Corners {
        let angles = self.angles(values);
        Corners(TrunkJoint::CORNERS.map(|joint| PI - angles[joint.index()]))
    }

    /// Positions of all `count` axes with the corners in this shape and both folds flat, in radians.
    #[must_use]
    pub fn values_of(&self, shape: &Corners, count: usize) -> Vec<f64> {
        let Corners([a, b, c, ..]) = *shape;
        let mut values = vec![PI; count];
        for (&axis, value) in self.axes.iter().zip([a, b, c]) {
            if let Some(slot) = values.get_mut(axis) {
                *slot = value;
            }
        }
        values
    }

    /// The poses of both cameras with the axes at `left` for the left one and at `right` for the right one, in radians.
    pub(crate) fn cameras_at(&self, left: &[f64], right: &[f64]) -> (Transform<Base, Left>, Transform<Base, Right>) {
        let linkage: Loop<{ TrunkJoint::COUNT }> = trunk(&self.links);
        let [left, right] = [left, right].map(|values| self.angles(values));
        // After the front fold x points to corner A and z backward.
        let base =
            Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI));
        let (a, f) = (TrunkJoint::A.index(), TrunkJoint::F.index());
        let fold_from_left_link = linkage.between(a, a, &left);
        let right_link_from_fold = linkage.between(f, TrunkJoint::FrontFold.index(), &right);
        (
            Transform::from_isometry(base * fold_from_left_link * self.cameras.link_from_left()),
            Transform::from_isometry(base * right_link_from_fold.inverse() * self.cameras.link_from_right()),
        )
    }

    /// The planar trunk for the search of paths.
    #[must_use]
    pub fn flat(&self) -> FlatTrunk {
        FlatTrunk { links: self.links.six_bar(), cameras: self.cameras, bodies: self.bodies, limits: self.limits }
    }

    /// Least and greatest angle of the side joints, both alike, in which nothing touches and no joint is beyond its range, in radians;
    /// up to straight, where gecko is.
    #[must_use]
    pub fn side_joints_alike(&self) -> [f64; 2] {
        const STEP: f64 = 1e-3;
        let flat = self.flat();
        let is_allowed = |side: &f64| !flat.clearance(&Corners::alike(*side)).is_forbidden();
        let steps = (PI / STEP) as u32;
        let least = (0..=steps).map(|step| f64::from(step) * STEP).find(is_allowed).unwrap_or(PI);
        [least, PI]
    }

    /// Whether both folds are flat with the axes at `values` in radians.
    #[must_use]
    pub fn is_flat(&self, values: &[f64]) -> bool {
        self.axes[3..].iter().all(|&axis| values.get(axis).is_none_or(|fold| (fold - PI).abs() < FLAT))
    }

    /// The path of the flat trunk between two sets of positions of its axes, in radians.
    ///
    /// # Errors
    /// [`NoPath`], also where a fold is not flat.
    pub fn path(&self, from: &[f64], to: &[f64], wanted: &WantedClearance) -> Result<TrunkPath, NoPath> {
        if !self.is_flat(from) || !self.is_flat(to) {
            return Err(NoPath::Folded);
        }
        self.flat().path(&self.shape(from), &self.shape(to), wanted)
    }
}
