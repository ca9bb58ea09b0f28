//! A move as the board will plan it: the same profiles from the same limits, so that it can be read before it is made.

use vergence_control::{FINE_BITS, Fine, Limits, MotionState, Trajectory};
use vergence_protocol::{AxisInfo, Micro};
use vergence_rig::{AxisPosition, Rig, RigAxis};

/// A planned move of all axes, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct MovePlan {
    /// Seconds; all axes start and finish together.
    pub duration: f64,
    /// One for each axis of the rig.
    pub axes: Vec<AxisPlan>,
}

/// What one axis does.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisPlan {
    /// From where.
    pub from: AxisPosition,
    /// To where.
    pub to: AxisPosition,
    /// Where each segment begins, and the end; empty where the axis stays.
    pub knots: Vec<Knot>,
}

/// An instant at which the jerk changes. In seconds and the unit of the axis: millimetres or radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Since the start of the move.
    pub time: f64,
    /// Where the axis is.
    pub position: f64,
    /// Per second.
    pub velocity: f64,
    /// Per second squared.
    pub acceleration: f64,
    /// Per second cubed, from here to the next knot; zero at the end.
    pub jerk: f64,
}

/// What the board's planner must know of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// As the board states it.
    pub info: AxisInfo,
    /// How far the last approach comes from below.
    pub backlash: Micro,
}

impl MovePlan {
    /// Plans the move of `rig` between two poses within the limits of the board.
    #[must_use]
    pub fn new(rig: &Rig, limits: &[AxisLimits], from: &[AxisPosition], to: &[AxisPosition]) -> Self {
        let ways: Vec<_> = rig.axes.iter().zip(limits).zip(from.iter().zip(to)).collect();
        let durations = ways.iter().map(|((_, limits), (from, to))| limits.plan(**from, **to, 0.0).duration());
        let slowest = durations.fold(0.0, f32::max);
        let axes = ways.iter().map(|((axis, limits), (from, to))| {
            let knots = knots(axis, &limits.plan(**from, **to, slowest));
            AxisPlan { from: **from, to: **to, knots }
        });
        Self { duration: f64::from(slowest), axes: axes.collect() }
    }
}

impl AxisLimits {
    fn plan(&self, from: AxisPosition, to: AxisPosition, at_least: f32) -> Trajectory {
        let [from, to, run_up] =
            [from.micro(), to.micro(), self.backlash].map(|micro| Fine::from(micro.0) << FINE_BITS);
        let [speed, acceleration, jerk] = [self.info.speed, self.info.acceleration, self.info.jerk].map(|it| it as f32);
        let limits = Limits { speed, acceleration, jerk };
        let start = MotionState::at(from);
        if run_up == 0 || from == to || from <= to - run_up {
            return Trajectory::reach(start, to, limits, at_least);
        }
        Trajectory::reach_from_below(start, (to, run_up), [limits, limits], at_least)
    }
}

impl AxisPlan {
    /// The largest speed on the way, per second.
    #[must_use]
    pub fn peak_speed(&self) -> f64 {
        self.knots.iter().map(|knot| knot.velocity.abs()).fold(0.0, f64::max)
    }
}

fn knots(axis: &RigAxis, planned: &Trajectory) -> Vec<Knot> {
    let value = |fine: Fine| axis.value_from_micro(fine as f64 / f64::from(1 << FINE_BITS));
    let knots = planned.knots().map(|(time, state, jerk)| Knot {
        time,
        position: value(state.position),
        velocity: value(state.velocity),
        acceleration: value(state.acceleration),
        jerk: value(jerk),
    });
    knots.collect()
}
