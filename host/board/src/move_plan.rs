//! The board's plan of a move, computed on the host by the board's own planner, so that it can be read before it is made.

use vergence_control::{
    AxisPlanner, FINE_BITS, Fine, Limits, MotionState, MovePlanner, PlanRequest, PlanStart, PlannedWay, Trajectory,
};
use vergence_protocol::{AxisInfo, Micro};
use vergence_rig::{AxisPosition, Rig, RigAxis};

/// A planned move of all axes, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct MovePlan {
    /// Duration in seconds; all axes start and finish together.
    pub duration: f64,
    /// The plan of each axis of the rig.
    pub axes: Vec<AxisPlan>,
}

/// The planned motion of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisPlan {
    /// Position at the start.
    pub from: AxisPosition,
    /// Target.
    pub to: AxisPosition,
    /// The starts of all segments, and the end; empty where the axis stays.
    pub knots: Vec<Knot>,
}

/// The state of an axis at an instant at which the jerk changes, in the unit of the axis: millimetres or radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Seconds since the start of the move.
    pub time: f64,
    /// Position.
    pub position: f64,
    /// Velocity, per second.
    pub velocity: f64,
    /// Acceleration, per second squared.
    pub acceleration: f64,
    /// Jerk, per second cubed, from here to the next knot; zero at the end.
    pub jerk: f64,
}

/// The limits and settings by which the board plans the motion of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// The board's description of the axis.
    pub info: AxisInfo,
    /// Distance below the target from which the last approach comes.
    pub backlash: Micro,
}

/// Where a move starts from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveStart<'a> {
    /// Position of each axis.
    pub positions: &'a [AxisPosition],
    /// Whether the board moved there by a planned move and has stayed armed since. After arming and after homing it does not
    /// know on which side the play is taken up, and comes from below even to where it stands.
    pub from_below: bool,
}

impl MovePlan {
    /// Plans the move of `rig` from `start` to the targets `to`, one for each axis, within the limits of the board.
    #[must_use]
    pub fn new(rig: &Rig, limits: &[AxisLimits], start: MoveStart<'_>, to: &[AxisPosition]) -> Self {
        let ways = limits.iter().zip(start.positions.iter().zip(to)).map(|(limits, (from, to))| {
            let motion = MotionState::at(Fine::from(from.micro().0) << FINE_BITS);
            let start = PlanStart { motion, from_below: start.from_below };
            PlannedWay { planner: limits.planner(), start, target: to.micro() }
        });
        let planned = MovePlanner::planned(PlanRequest { number: 0, share: FULL_SPEED, ways: ways.collect() });
        let ways = rig.axes.iter().zip(start.positions.iter().zip(to));
        let axes = ways.zip(planned.trajectories()).map(|((axis, (from, to)), trajectory)| AxisPlan {
            from: *from,
            to: *to,
            knots: knots(axis, trajectory),
        });
        Self { duration: f64::from(planned.duration()), axes: axes.collect() }
    }
}

/// Share of full speed at which verbs move.
const FULL_SPEED: f32 = 1.0;

impl AxisLimits {
    fn planner(&self) -> AxisPlanner {
        let [speed, acceleration, jerk] = [self.info.speed, self.info.acceleration, self.info.jerk].map(|it| it as f32);
        AxisPlanner { limits: Limits { speed, acceleration, jerk }, backlash: self.backlash }
    }
}

impl AxisPlan {
    /// The largest speed on the way, in units per second.
    #[must_use]
    pub fn peak_speed(&self) -> f64 {
        self.knots.iter().map(|knot| knot.velocity.abs()).fold(0.0, f64::max)
    }
}

/// The knots of a trajectory in the unit of the axis.
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
