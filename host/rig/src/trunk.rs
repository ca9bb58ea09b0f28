//! A rig whose cameras ride on a folding trunk in place of stages.

mod closure;
mod parameters;

use std::f64::consts::PI;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vergence_vision::{Base, Left, Right, Transform};

use crate::axis::RigAxis;
use crate::linkage::{
    CornerLimits, Corners, FlatTrunk, FoldingTrunk, Loop, NoPath, PathEnd, TrunkBodies, TrunkCameras, TrunkJoint,
    TrunkLinks, TrunkPath, TrunkShape, WantedClearance, trunk,
};
use crate::track::UNIFORM;

pub use closure::{OpenLoop, TrunkClosure};
pub use parameters::{
    TRUNK_PARAMETER_NAMES, TRUNK_PARAMETERS, TrunkCovariance, TrunkParameterKind, TrunkParameters, TrunkTolerance,
};

/// Number of axes of a trunk: its driven joints.
pub const TRUNK_AXES: usize = 5;
/// How far the joints of a folded trunk may be from the nearest closed shape by play and noise: 3 degrees.
const ALIKE_WITHIN: f64 = 0.0524;
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
    /// How far links, mounts and zeros may be from what is stated here: what a calibration assumes of its start.
    pub tolerance: TrunkTolerance,
    /// Covariance of the parameters after a calibration; `None` of a trunk that is only drawn.
    pub covariance: Option<Box<TrunkCovariance>>,
}

impl TrunkParameters {
    /// The angles of the joints of the loop with the driven joints at `driven` plus their zeros, as [`RigTrunk`] defines them.
    fn angles(&self, driven: [f64; TRUNK_AXES]) -> [f64; TrunkJoint::COUNT] {
        let [a, b, c, rear, front] = std::array::from_fn(|joint| driven[joint] + self.zeros[joint]);
        // The loop folds at both ends alike, or not at all: each encoder tells half.
        let fold = 0.5 * (rear + front);
        let shape = if RigTrunk::are_flat([rear, front]) {
            self.links.six_bar().outward_or_straight([a, b, c])
        } else {
            Corners([a, b, c, c, b, a])
        };
        let mut angles = shape.trunk_angles();
        angles[TrunkJoint::RearFold.index()] = PI - fold;
        angles[TrunkJoint::FrontFold.index()] = PI - fold;
        angles
    }

    /// The poses of both cameras with the driven joints at the first positions for the left one and at the second for the right one.
    pub(crate) fn cameras_at(&self, driven: [[f64; TRUNK_AXES]; 2]) -> (Transform<Base, Left>, Transform<Base, Right>) {
        let [left, right] = driven.map(|driven| self.angles(driven));
        self.cameras_of([&left, &right])
    }

    /// The poses of both cameras with the joints of the loop at the first angles for the left one and at the second for the right one.
    fn cameras_of(
        &self,
        [left, right]: [&[f64; TrunkJoint::COUNT]; 2],
    ) -> (Transform<Base, Left>, Transform<Base, Right>) {
        let linkage: Loop<{ TrunkJoint::COUNT }> = trunk(&self.links);
        // After the front fold x points to corner A and z backward.
        let base =
            Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI));
        let (a, f) = (TrunkJoint::A.index(), TrunkJoint::F.index());
        let fold_from_left_link = linkage.between(a, a, left);
        let right_link_from_fold = linkage.between(f, TrunkJoint::FrontFold.index(), right);
        (
            Transform::from_isometry(base * fold_from_left_link * self.cameras.link_from_left()),
            Transform::from_isometry(base * right_link_from_fold.inverse() * self.cameras.link_from_right()),
        )
    }
}

impl RigTrunk {
    /// Its parameters, with the zeros of its joints as the axes have them.
    #[must_use]
    pub const fn parameters(&self) -> TrunkParameters {
        TrunkParameters { zeros: [0.0; TRUNK_AXES], links: self.links, cameras: self.cameras }
    }

    /// The positions of the driven joints, in the order of [`TrunkJoint::DRIVEN`], with the axes at `values`; straight where one is
    /// missing.
    #[must_use]
    pub fn driven(&self, values: &[f64]) -> [f64; TRUNK_AXES] {
        self.axes.map(|axis| values.get(axis).copied().unwrap_or(PI))
    }

    /// The angles of the joints of the loop with the axes at `values` in radians.
    ///
    /// With flat folds corner E is outward. Angles for which the loop does not close, by play or noise at a dead centre, give the
    /// shape with D, E and F in line. A folded trunk has both sides alike: no other shape of it closes.
    #[must_use]
    pub fn angles(&self, values: &[f64]) -> [f64; TrunkJoint::COUNT] {
        self.parameters().angles(self.driven(values))
    }

    /// The shape with the axes at `values` in radians.
    #[must_use]
    pub fn shape(&self, values: &[f64]) -> Corners {
        let angles = self.angles(values);
        Corners(TrunkJoint::CORNERS.map(|joint| PI - angles[joint.index()]))
    }

    /// Positions of all `count` axes in this shape, in radians.
    #[must_use]
    pub fn values_of(&self, shape: &TrunkShape, count: usize) -> Vec<f64> {
        let Corners([a, b, c, ..]) = shape.corners;
        let mut values = vec![PI; count];
        for (&axis, value) in self.axes.iter().zip([a, b, c, shape.fold, shape.fold]) {
            if let Some(slot) = values.get_mut(axis) {
                *slot = value;
            }
        }
        values
    }

    /// The poses of both cameras with the axes at `left` for the left one and at `right` for the right one, in radians.
    pub(crate) fn cameras_at(&self, left: &[f64], right: &[f64]) -> (Transform<Base, Left>, Transform<Base, Right>) {
        self.parameters().cameras_at([left, right].map(|values| self.driven(values)))
    }

    /// The poses of both cameras with the joints of the loop at these angles in radians, in the order of [`TrunkJoint`]: of a trunk whose
    /// joints are known otherwise than by its axes.
    #[must_use]
    pub fn cameras_of(&self, angles: &[f64; TrunkJoint::COUNT]) -> (Transform<Base, Left>, Transform<Base, Right>) {
        self.parameters().cameras_of([angles; 2])
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

    /// Standard deviation in radians of a driven joint, in the order of [`TrunkJoint::DRIVEN`], beside what its encoder shows at rest:
    /// by the encoder's step, the play of its axis, and for a corner that of a passive joint, which turns the loop as well.
    #[must_use]
    pub fn reading_sigma(&self, joint: usize, axes: &[RigAxis]) -> f64 {
        self.sigma_of(joint, axes, UNIFORM)
    }

    /// As [`Self::reading_sigma`], for a reading whose own standard deviation is `reading` counts.
    pub(crate) fn sigma_of(&self, joint: usize, axes: &[RigAxis], reading: f64) -> f64 {
        let axis = self.axes.get(joint).and_then(|&axis| axes.get(axis));
        let driven = axis.map_or(0.0, |axis| axis.sigma_with_play(reading) * axis.value_per_count());
        if joint < 3 { driven.hypot(0.5 * self.passive_play) } else { driven }
    }

    /// Whether both folds, at these angles in radians, are flat.
    pub(crate) fn are_flat(folds: [f64; 2]) -> bool {
        folds.iter().all(|fold| (fold - PI).abs() < FLAT)
    }

    /// Whether a flat shape is so near a dead centre of the linkage that its driven joints, off by a degree at once, may have no shape
    /// at all: there the joints tell little of the passive ones.
    #[must_use]
    pub fn is_near_dead_centre(&self, values: &[f64]) -> bool {
        self.is_near_dead_centre_at(self.driven(values))
    }

    /// As [`Self::is_near_dead_centre`], with the driven joints at these positions.
    pub(crate) fn is_near_dead_centre_at(&self, driven: [f64; TRUNK_AXES]) -> bool {
        let [a, b, c, folds @ ..] = driven;
        let reserve = self.flat().loop_reserve(&self.links.six_bar().outward_or_straight([a, b, c]));
        Self::are_flat(folds) && reserve < WantedClearance::default().loop_reserve
    }

    /// Whether both folds are flat with the axes at `values` in radians.
    #[must_use]
    pub fn is_flat(&self, values: &[f64]) -> bool {
        let [.., rear, front] = self.driven(values);
        Self::are_flat([rear, front])
    }

    /// The trunk with its folds for the search of paths.
    #[must_use]
    pub fn folding(&self) -> FoldingTrunk {
        FoldingTrunk { flat: self.flat(), links: self.links }
    }

    /// The path between two sets of positions of its axes, in radians.
    ///
    /// # Errors
    /// [`NoPath`], also where the trunk is folded and both sides or both folds differ by more than play and noise.
    pub fn path(&self, from: &[f64], to: &[f64], wanted: &WantedClearance) -> Result<TrunkPath, NoPath> {
        let [start, goal] = [self.closed(from, PathEnd::Start)?, self.closed(to, PathEnd::Goal)?];
        self.folding().path(&start, &goal, wanted)
    }

    /// The closed shape at these positions of the axes; of a folded trunk the nearest one, by least squares of its driven joints.
    fn closed(&self, values: &[f64], end: PathEnd) -> Result<TrunkShape, NoPath> {
        if self.is_flat(values) {
            return Ok(TrunkShape::flat(self.shape(values)));
        }
        let driven = self.driven(values);
        let [a, b, c, rear, front] = driven;
        // Of the angle b by which A and C are half a turn less b/2.
        let side_joint = (b + PI - 0.5 * (a + c)) / 1.5;
        // Noise at straight sides is no shape whose sides turn in.
        let side_joint = if side_joint < PI + ALIKE_WITHIN { side_joint.min(PI) } else { side_joint };
        let shape = TrunkShape::alike(side_joint, f64::midpoint(rear, front));
        let nearest = self.driven(&self.values_of(&shape, values.len()));
        let by = driven.iter().zip(nearest).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
        if by > ALIKE_WITHIN {
            return Err(NoPath::NotAlike { end, by });
        }
        Ok(shape)
    }
}
