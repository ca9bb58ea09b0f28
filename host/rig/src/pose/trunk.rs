//! What the errors of a trunk's joints, and of its calibration, make of the relative pose.

use nalgebra::{Matrix6, SMatrix, SVector};
use vergence_vision::{Left, Right, Transform};

use super::difference;
use crate::rig::Rig;
use crate::track::JointsAt;
use crate::trunk::{RigTrunk, TRUNK_AXES, TRUNK_PARAMETERS, TrunkClosure, TrunkCovariance, TrunkParameters};

type Numbers = SVector<f64, TRUNK_PARAMETERS>;

/// Number of driven corners; the other driven joints are folds.
const CORNERS: usize = 3;
/// From this many standard deviations of the distance of corners D and F on, a dead centre is too far to be felt.
const FAR: f64 = 12.0;
/// Half of the number of nodes across a dead centre, and their distance in standard deviations: the trapezoid rule of a normal
/// density, which converges faster than any power of the step (L. Trefethen and J. Weideman, SIAM Review 56(3), 2014).
const NODES: i32 = 8;
const NODE_STEP: f64 = 0.5;

impl Rig {
    /// The trunk and the covariance of its numbers, where it is calibrated.
    pub(super) fn calibrated_trunk(&self) -> Option<(&RigTrunk, &TrunkCovariance)> {
        let trunk = self.trunk.as_deref()?;
        Some((trunk, trunk.covariance.as_deref()?))
    }

    /// Covariance of the relative pose that the calibration of a trunk leaves with the axes at exactly `values`; `None` where no
    /// trunk is calibrated.
    #[must_use]
    pub fn trunk_calibration_covariance(&self, values: &[f64]) -> Option<Matrix6<f64>> {
        let (trunk, covariance) = self.calibrated_trunk()?;
        let stated = self.transforms(values, values).1;
        Some(Spread { trunk, driven: [trunk.driven(values); 2], stated }.second_moment(covariance))
    }

    /// Mean square of the way from the `stated` relative pose to the true one: by errors of a trunk's corners, and of a calibrated trunk
    /// by those of all joints and of all its numbers. See [`Spread::second_moment`].
    pub(super) fn trunk_spread(
        &self,
        trunk: &RigTrunk,
        left: &JointsAt,
        right: &JointsAt,
        stated: &Transform<Left, Right>,
    ) -> Matrix6<f64> {
        let driven = [left, right].map(|joints| trunk.driven(&self.values(joints)));
        let mut errors = self.with_readings(
            trunk,
            trunk.covariance.as_deref().copied().unwrap_or_else(TrunkCovariance::zeros),
            left,
        );
        if trunk.covariance.is_none() {
            // Those of the folds count with the readings of the axes.
            (CORNERS..TRUNK_AXES).for_each(|fold| errors[(fold, fold)] = 0.0);
        }
        Spread { trunk, driven, stated: *stated }.second_moment(&errors)
    }

    /// The covariance of a trunk's numbers with the errors of the readings and of play added to those of the zeros.
    fn with_readings(&self, trunk: &RigTrunk, numbers: TrunkCovariance, joints: &JointsAt) -> TrunkCovariance {
        let mut total = numbers;
        for joint in 0..TRUNK_AXES {
            let reading = joints.sigma.get(trunk.axes[joint]).copied().unwrap_or(0.0);
            total[(joint, joint)] += trunk.sigma_of(joint, &self.axes, reading).powi(2);
        }
        total
    }

    /// How the readings fit the closed loop. Of a trunk that is not calibrated, the zeros are known to their tolerance.
    pub(super) fn closure(&self, trunk: &RigTrunk, joints: &JointsAt) -> TrunkClosure {
        let drawn = || {
            let zero = trunk.tolerance.joint_zero.powi(2);
            TrunkCovariance::from_diagonal(&Numbers::from_fn(|number, _| if number < TRUNK_AXES { zero } else { 0.0 }))
        };
        let numbers = trunk.covariance.as_deref().map_or_else(drawn, |found| *found);
        let names = trunk.axes.map(|axis| self.axes.get(axis).map_or("", |axis| axis.name.as_str()));
        let driven = trunk.driven(&self.values(joints));
        TrunkClosure::of(trunk, driven, &self.with_readings(trunk, numbers, joints), names)
    }
}

/// A trunk whose numbers are off.
struct Spread<'a> {
    trunk: &'a RigTrunk,
    /// Positions of the driven joints for the left and for the right camera.
    driven: [[f64; TRUNK_AXES]; 2],
    stated: Transform<Left, Right>,
}

impl Spread<'_> {
    fn off(&self, by: &Numbers) -> TrunkParameters {
        TrunkParameters::from_array(&(Numbers::from(self.trunk.parameters().to_array()) + by).into())
    }

    /// The way from the stated relative pose to the one with the numbers off.
    fn way(&self, by: &Numbers) -> SVector<f64, 6> {
        let (base_from_left, base_from_right) = self.off(by).cameras_at(self.driven);
        difference(&self.stated, &(base_from_left.inverse() * base_from_right))
    }

    /// Mean square of that way for normal errors of this covariance, around the stated pose.
    ///
    /// Near a dead centre the pose follows the distance of corners D and F as a square root and stays at its end beyond. So it is
    /// summed over nodes along the errors that change this distance, and taken to first order across them, where it is smooth.
    fn second_moment(&self, covariance: &TrunkCovariance) -> Matrix6<f64> {
        let root = root(covariance);
        let (towards, nearness) = self.towards_dead_centre(&root);
        let mut directions = root * reflection(&towards);
        let mut nodes = vec![(0.0, 1.0)];
        if nearness < FAR {
            let weight = |node: i32| (-0.5 * (NODE_STEP * f64::from(node)).powi(2)).exp();
            let total: f64 = (-NODES..=NODES).map(weight).sum();
            nodes = (-NODES..=NODES).map(|node| (NODE_STEP * f64::from(node), weight(node) / total)).collect();
        }
        let along: Numbers = directions.column(0).into_owned();
        if nodes.len() > 1 {
            directions.column_mut(0).fill(0.0);
        }
        let mut moment = Matrix6::zeros();
        for (place, weight) in nodes {
            let middle = along * place;
            let way = self.way(&middle);
            moment += way * way.transpose() * weight;
            for direction in directions.column_iter().filter(|direction| direction.amax() > 0.0) {
                let slope = (self.way(&(middle + direction)) - self.way(&(middle - direction))) / 2.0;
                moment += slope * slope.transpose() * weight;
            }
        }
        moment
    }

    /// The direction of independent errors that moves corners D and F apart, and how many of its standard deviations the dead centre
    /// is away; infinitely many where the trunk is folded.
    fn towards_dead_centre(&self, root: &TrunkCovariance) -> (Numbers, f64) {
        let driven = self.driven[1];
        if !RigTrunk::are_flat([driven[3], driven[4]]) {
            return (Numbers::x(), f64::INFINITY);
        }
        let beyond = |by: &Numbers| {
            let off = self.off(by);
            let [a, b, c] = [0, 1, 2].map(|joint: usize| driven[joint] + off.zeros[joint]);
            off.links.six_bar().beyond_reach([a, b, c])
        };
        let slopes = Numbers::from_iterator(
            root.column_iter().map(|column| (beyond(&column.into_owned()) - beyond(&(-column))) / 2.0),
        );
        let sigma = slopes.norm();
        if sigma > 0.0 {
            (slopes / sigma, (beyond(&Numbers::zeros()) / sigma).abs())
        } else {
            (Numbers::x(), f64::INFINITY)
        }
    }
}

/// A matrix whose product with its transpose is the covariance, or nearly so where rounding has made that singular.
fn root(covariance: &TrunkCovariance) -> TrunkCovariance {
    let scale = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let inverse = scale.map(|scale| if scale > 0.0 { 1.0 / scale } else { 0.0 });
    let scaled = TrunkCovariance::from_fn(|i, j| covariance[(i, j)] * inverse[i] * inverse[j]);
    let eigen = scaled.symmetric_eigen();
    let lengths = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    SMatrix::from_diagonal(&scale) * eigen.eigenvectors * SMatrix::from_diagonal(&lengths)
}

/// The reflection that takes the first axis to the unit vector `to` (A. Householder, J. ACM 5(4), 1958).
fn reflection(to: &Numbers) -> TrunkCovariance {
    let way = to - Numbers::x();
    let square = way.norm_squared();
    if square < 1e-24 {
        return TrunkCovariance::identity();
    }
    TrunkCovariance::identity() - way * way.transpose() * (2.0 / square)
}
