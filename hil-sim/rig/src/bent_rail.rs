//! A rail that is not straight: it shifts what slides on it, and turns it by its slope.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use vergence_rig::{Chain, Rig, RigPose, Screw};
use vergence_vision::{Base, Frame, Left, Right, Transform};

/// A rail that is bent to a parabola between the ends of an axis's range, where it is as drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BentRail {
    /// Index of the linear axis.
    pub axis: usize,
    /// How far the middle of the rail is off, in millimetres in the base frame. A part along the rail has no effect.
    pub sagitta: Vector3<f64>,
}

impl BentRail {
    /// The pose of `rig` with its axes at `values` (millimetres or radians), with this rail; uncertain as the straight rig.
    #[must_use]
    pub fn pose(&self, rig: &Rig, values: &[f64]) -> RigPose {
        let (base_from_left, left_from_right) = self.cameras(rig, values);
        RigPose { base_from_left, left_from_right, ..rig.pose_at_values(values) }
    }

    /// The poses of both cameras in it.
    pub(crate) fn cameras(&self, rig: &Rig, values: &[f64]) -> (Transform<Base, Left>, Transform<Left, Right>) {
        let base_from_left = self.base_from_camera(rig, &rig.left_chain, values);
        let base_from_right = self.base_from_camera(rig, &rig.right_chain, values);
        (base_from_left, base_from_left.inverse() * base_from_right)
    }

    fn base_from_camera<C: Frame>(&self, rig: &Rig, chain: &Chain<C>, values: &[f64]) -> Transform<Base, C> {
        let moved = chain.links().iter().fold(Isometry3::identity(), |pose, link| {
            let value = values.get(link.axis).copied().unwrap_or(0.0);
            let slid = pose * link.screw.displacement(link.share * value);
            match link.screw {
                Screw::Slide { along } if link.axis == self.axis => slid * self.bend(rig, value, along.into_inner()),
                _ => slid,
            }
        });
        Transform::from_isometry(moved * chain.at_zero().isometry())
    }

    /// What the bend does to a carriage at `value` millimetres that slides `along`.
    fn bend(&self, rig: &Rig, value: f64, along: Vector3<f64>) -> Isometry3<f64> {
        let Some(axis) = rig.axes.get(self.axis) else { return Isometry3::identity() };
        let [min, max] = axis.range.map(|end| end.value());
        let across = self.sagitta - along * along.dot(&self.sagitta);
        // From -1 at one end to 1 at the other.
        let place = (2.0 * value - min - max) / (max - min);
        let slope = across * (-4.0 * place / (max - min));
        let turn = UnitQuaternion::from_scaled_axis(along.cross(&slope));
        Translation3::from(across * (1.0 - place.powi(2))) * turn
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails loudly")]

    use vergence_vision::{Point, UnitRay, pseudo_intersection};

    use super::*;
    use crate::SimulatedRig;

    fn bench() -> Rig {
        Rig::from_toml(vergence_rig::BENCH_TOML).expect("the bench")
    }

    /// Bent forward, away from the rig, by a tenth of a millimetre.
    fn bent() -> BentRail {
        BentRail { axis: 0, sagitta: Vector3::new(0.3, 0.0, 0.1) }
    }

    fn right_camera(baseline: f64) -> Isometry3<f64> {
        let pose = bent().pose(&bench(), &[baseline, 0.0]);
        *(pose.base_from_left * pose.left_from_right).isometry()
    }

    #[test]
    fn the_carriage_is_off_in_the_middle_and_turned_at_the_ends() {
        for (baseline, off, turn) in [(60.0, 0.0, 2.5e-3), (140.0, 0.1, 0.0), (220.0, 0.0, -2.5e-3)] {
            let right = right_camera(baseline);
            assert!((right.translation.vector - Vector3::new(baseline, 0.0, off)).norm() < 1e-12, "{right}");
            // Towards +z for a rising x is a turn about -y.
            let found = right.rotation.scaled_axis();
            assert!((found - Vector3::new(0.0, -turn, 0.0)).norm() < 1e-12, "{found}");
        }
        // The turn is the slope of the way.
        let [before, after] = [100.0 - 1e-4, 100.0 + 1e-4].map(|baseline| right_camera(baseline).translation.vector);
        let way = (after - before).normalize();
        assert!((right_camera(100.0).rotation * Vector3::x() - way).norm() < 1e-7);
    }

    /// What a straight rig makes of a point straight ahead that both cameras see.
    fn depth_error(baseline: f64, depth: f64) -> f64 {
        let (rig, values) = (bench(), [baseline, 0.0]);
        let [straight, bent] =
            [rig.pose_at_values(&values), bent().pose(&rig, &values)].map(|pose| pose.left_from_right);
        let point = Point::<Left>::from_mm(Vector3::new(baseline / 2.0, 0.0, depth));
        let seen = UnitRay::<Right>::new((bent.inverse() * point).mm()).expect("a direction");
        let left = UnitRay::<Left>::new(point.mm()).expect("a direction");
        let found = pseudo_intersection(&left, &(straight * seen), &straight.origin()).expect("they meet");
        found.point.mm().z - depth
    }

    #[test]
    fn depth_is_off_by_the_turn() {
        for (baseline, expected) in [(60.0, 5.1), (220.0, -1.4)] {
            let error = depth_error(baseline, 350.0);
            // An angle of 2.5 mrad over the parallax.
            assert!((error - expected).abs() < 0.3, "baseline {baseline} mm: {error:.2} mm");
        }
        assert!(depth_error(140.0, 350.0).abs() < 0.2);
    }

    #[test]
    fn a_simulated_rig_has_its_rail() {
        let rig = bench();
        let mut simulated = SimulatedRig::new(&rig, 1).expect("the bench");
        simulated.run_until(10_000);
        let straight = simulated.true_pose();
        simulated.bend_rail(bent());
        let values = straight.axes.iter().map(|axis| axis.value()).collect::<Vec<_>>();
        assert_eq!(simulated.true_pose(), bent().pose(&rig, &values));
        assert_ne!(simulated.true_pose().left_from_right, straight.left_from_right);
        let now = simulated.now().0 as f64;
        let remembered = simulated.history().pose_at(&rig, now).expect("it is kept");
        assert_eq!(remembered.left_from_right, simulated.true_pose().left_from_right);
    }
}
