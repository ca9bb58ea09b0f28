//! True positions of simulated mechanics during the last second, for the cameras on them.

use std::collections::VecDeque;
use std::f64::consts::PI;

use vergence_protocol::Microseconds;
use vergence_rig::linkage::TrunkJoint;
use vergence_rig::{AxisPosition, Rig, RigPose, RigTrunk};
use vergence_vision::{Angle, Base, Left, Length, Right, SharedCovariance, Transform};

use crate::BentRail;

/// Number of ticks that are kept: more than any exposure and its way to the host take.
const KEPT: usize = 1_000;

/// True positions of the mechanics, tick by tick.
#[derive(Clone, Debug, Default)]
pub struct LoadHistory {
    /// Time on the board's clock in microseconds, and the load's position on every axis in micro-units, or the angle of each joint
    /// of a trunk in radians.
    ticks: VecDeque<(f64, Vec<f64>)>,
    /// The rail, where it is not straight.
    pub(crate) rail: Option<BentRail>,
}

impl LoadHistory {
    /// Adds a tick. One not after the last discards what was kept: the board's clock has started again.
    pub fn push(&mut self, at: Microseconds, loads: Vec<f64>) {
        let at = at.0 as f64;
        if self.ticks.back().is_some_and(|(last, _)| *last >= at) {
            self.ticks.clear();
        }
        if self.ticks.len() == KEPT {
            self.ticks.pop_front();
        }
        self.ticks.push_back((at, loads));
    }

    /// The ticks around `from_us` to `to_us` on the board's clock.
    #[must_use]
    pub fn between(&self, from_us: f64, to_us: f64) -> Self {
        let first = self.ticks.partition_point(|(at, _)| *at <= from_us).saturating_sub(1);
        let end = (self.ticks.partition_point(|(at, _)| *at < to_us) + 1).min(self.ticks.len());
        Self { ticks: self.ticks.range(first.min(end)..end).cloned().collect(), rail: self.rail }
    }

    /// True pose of `rig` at `us` microseconds on the board's clock, interpolated linearly between two ticks: at the bench's
    /// largest acceleration the error is below 0.1 um. `None` where nothing is kept.
    #[must_use]
    pub fn pose_at(&self, rig: &Rig, us: f64) -> Option<RigPose> {
        Some(self.pose_of(rig, &self.loads_at(us)?))
    }

    /// The poses of both cameras in it: all that an image needs, which has one for each row.
    pub(crate) fn cameras_at(&self, rig: &Rig, us: f64) -> Option<(Transform<Base, Left>, Transform<Left, Right>)> {
        let loads = self.loads_at(us)?;
        if let Some(trunk) = &rig.trunk {
            let (base_from_left, base_from_right) = trunk.cameras_of(&joints(&loads));
            return Some((base_from_left, base_from_left.inverse() * base_from_right));
        }
        let values = values(rig, &loads);
        Some(self.rail.map_or_else(|| rig.cameras_at_values(&values), |rail| rail.cameras(rig, &values)))
    }

    fn loads_at(&self, us: f64) -> Option<Vec<f64>> {
        let next = self.ticks.partition_point(|(at, _)| *at < us);
        let (to, after) = self.ticks.get(next).or(self.ticks.back())?;
        let (from, before) = self.ticks.get(next.saturating_sub(1))?;
        let share = if to > from { ((us - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        Some(before.iter().zip(after).map(|(before, after)| before + share * (after - before)).collect())
    }

    /// True pose of `rig` with its loads at these positions, in micro-units, or the joints of its trunk at these angles.
    pub(crate) fn pose_of(&self, rig: &Rig, loads: &[f64]) -> RigPose {
        if let Some(trunk) = &rig.trunk {
            return true_pose(rig, trunk, loads);
        }
        let values = values(rig, loads);
        match self.rail {
            Some(rail) => rail.pose(rig, &values),
            None => rig.pose_at_values(&values),
        }
    }
}

/// The values of the axes with their loads at these positions, in micro-units.
fn values(rig: &Rig, loads: &[f64]) -> Vec<f64> {
    rig.axes.iter().zip(loads).map(|(axis, &load)| axis.value_from_micro(load)).collect()
}

/// The angles of all joints of a trunk's loop.
fn joints(angles: &[f64]) -> [f64; TrunkJoint::COUNT] {
    std::array::from_fn(|joint| angles.get(joint).copied().unwrap_or_default())
}

/// True pose of a trunk with the joints of its loop at these angles.
fn true_pose(rig: &Rig, trunk: &RigTrunk, angles: &[f64]) -> RigPose {
    let angles = joints(angles);
    let (base_from_left, base_from_right) = trunk.cameras_of(&angles);
    let mut values = vec![PI; rig.axes.len()];
    for (joint, axis) in TrunkJoint::DRIVEN.into_iter().zip(trunk.axes) {
        if let Some(value) = values.get_mut(axis) {
            *value = PI - angles[joint.index()];
        }
    }
    RigPose {
        base_from_left,
        left_from_right: base_from_left.inverse() * base_from_right,
        axes: rig.axes.iter().zip(values).map(|(axis, value)| AxisPosition::from_value(axis.kind, value)).collect(),
        rotation_sigma: Angle::from_rad(0.0),
        translation_sigma: Length::from_mm(0.0),
        shared: SharedCovariance::exact(),
        is_calibration_known: true,
        // Nothing was read.
        closure: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_lies_between_two_ticks() {
        let rig = Rig::from_toml(vergence_rig::BENCH_TOML).expect("the bench");
        let mut history = LoadHistory::default();
        for tick in 0..2_000u32 {
            history.push(Microseconds(u64::from(tick) * 1_000), vec![100_000.0 + 80.0 * f64::from(tick), 0.0]);
        }
        let part = history.between(1_500_400.0, 1_502_600.0);
        assert_eq!(part.ticks.len(), 4);
        let baseline = |us| part.pose_at(&rig, us).expect("it is kept").axes[0].value();
        assert!((baseline(1_501_250.0) - (100.0 + 0.08 * 1_501.25)).abs() < 1e-9);
        // After the last tick nothing moves.
        assert!((baseline(9e9) - (100.0 + 0.08 * 1_503.0)).abs() < 1e-9);
        assert!(LoadHistory::default().pose_at(&rig, 0.0).is_none());
        assert!(LoadHistory::default().cameras_at(&rig, 0.0).is_none());
    }

    /// On a straight rail, on a bent one, and of a trunk.
    #[test]
    fn an_image_has_the_cameras_where_the_pose_has_them() {
        let bench = vergence_rig::BENCH_TOML;
        let rigs = [bench, bench, include_str!("../../../docs/rigs/origaker.toml")];
        let bent = BentRail { axis: 0, sagitta: nalgebra::Vector3::new(0.3, 0.0, 0.1) };
        for (toml, rail) in rigs.into_iter().zip([None, Some(bent), None]) {
            let rig = Rig::from_toml(toml).expect("a rig");
            let mut history = LoadHistory { rail, ..LoadHistory::default() };
            let loads =
                |tick: f64| if rig.trunk.is_some() { vec![0.3 + 0.1 * tick; 8] } else { vec![1e5 + 80.0 * tick; 2] };
            (0..2_u32).for_each(|tick| history.push(Microseconds(u64::from(tick)), loads(f64::from(tick))));
            let pose = history.pose_at(&rig, 0.4).expect("it is kept");
            assert_eq!(history.cameras_at(&rig, 0.4), Some((pose.base_from_left, pose.left_from_right)));
        }
    }
}
