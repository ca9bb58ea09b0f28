//! Planning a move of several axes that start and finish together, one axis at a time, so that a board can do other work
//! between two steps.
//!
//! The controller asks for plans ([`crate::Controller::take_plan_request`]); a host that shows a move before it is made
//! plans with the same code.

use vergence_protocol::{AxisList, Micro};

use crate::plan::{AxisPlanner, PlanStart};
use crate::profile::Limits;
use crate::trajectory::{FINE_BITS, Fine, Trajectory};

/// Durations of axes agree when they differ by less than this share. From rest that takes two rounds.
const AGREED: f32 = 1e-5;
/// Largest number of rounds in which axes look for a common duration.
const MOST_ROUNDS: u32 = 4;

/// A move to be planned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanRequest {
    /// Names the request to the controller; zero for a plan that no controller has asked for.
    pub number: u32,
    /// Share of full speed, above 0 and at most 1.
    pub share: f32,
    /// The way of each axis.
    pub ways: AxisList<PlannedWay>,
}

impl PlanRequest {
    /// Lowers the limits of a move from rest so that all axes are at the same share of their ways at every instant: the links of a
    /// robot's trunk form a closed loop, which a straight way of its joints keeps closed. A move from mid-move stays as it is.
    pub fn straighten(&mut self) {
        let length = |way: &PlannedWay| {
            let target = Fine::from(way.target.0) << FINE_BITS;
            (target - way.start.motion.position).unsigned_abs() as f32
        };
        if !self.ways.iter().all(|way| way.start.motion.is_rest()) {
            return;
        }
        let limits =
            |way: &PlannedWay| [way.planner.limits.speed, way.planner.limits.acceleration, way.planner.limits.jerk];
        let mut least = [f32::INFINITY; 3];
        for way in self.ways.iter().filter(|way| length(way) > 0.0) {
            for (least, limit) in least.iter_mut().zip(limits(way)) {
                *least = least.min(limit / length(way));
            }
        }
        for way in self.ways.iter_mut().filter(|way| length(way) > 0.0) {
            let [speed, acceleration, jerk] = least.map(|least| least * length(way));
            way.planner.limits = Limits { speed, acceleration, jerk };
        }
    }
}

/// The way of one axis: its limits, the state in which it will be when the plan begins, and its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedWay {
    /// Limits and play of the axis.
    pub planner: AxisPlanner,
    /// State at the begin of the plan.
    pub start: PlanStart,
    /// Target in micro-units.
    pub target: Micro,
}

/// A move while it is planned, and its plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovePlanner {
    request: PlanRequest,
    trajectories: AxisList<Trajectory>,
    round: u32,
    /// Seconds from the start to the end of the slowest axis.
    duration: f32,
    /// What each axis is planned to take at least, in seconds: a little less than `duration`, so that rounding does not
    /// slow the slowest axis down.
    at_least: f32,
    /// Whether the trajectories are those of the last round.
    is_last: bool,
}

impl MovePlanner {
    /// Plans the whole move at once.
    #[must_use]
    pub fn planned(request: PlanRequest) -> Self {
        let mut planner = Self::default();
        planner.begin(request);
        while !planner.step() {}
        planner
    }

    /// Drops what was planned and begins another move.
    pub fn begin(&mut self, request: PlanRequest) {
        self.request = request;
        self.trajectories.clear();
        (self.round, self.is_last) = (0, false);
        (self.duration, self.at_least) = (0.0, 0.0);
    }

    /// Plans one axis once. Returns whether the whole move is planned; further calls change nothing.
    pub fn step(&mut self) -> bool {
        if let Some(way) = self.request.ways.get(self.trajectories.len()) {
            let planned = way.planner.plan(way.start, way.target, self.request.share, self.at_least);
            // As many trajectories as ways, in lists of the same size.
            let _ = self.trajectories.push(planned);
        }
        if self.trajectories.len() < self.request.ways.len() {
            return false;
        }
        if !self.is_last {
            self.agree();
        }
        self.is_planned()
    }

    /// Ends a round: takes the time of its slowest axis, and begins the next round, which is the last when the time no
    /// longer grows. An axis in mid-move may not be able to take just that long: then the others wait for it.
    fn agree(&mut self) {
        let slowest = self.trajectories.iter().map(Trajectory::duration).fold(0.0, f32::max);
        self.round += 1;
        self.is_last = slowest <= self.duration * (1.0 + AGREED) || self.round == MOST_ROUNDS;
        self.duration = slowest;
        self.at_least = slowest * (1.0 - AGREED);
        self.trajectories.clear();
    }

    fn is_planned(&self) -> bool {
        self.is_last && self.trajectories.len() == self.request.ways.len()
    }

    /// The request that is planned.
    #[must_use]
    pub fn request(&self) -> &PlanRequest {
        &self.request
    }

    /// Seconds from the start of the move to the end of its slowest axis; the others rest until then.
    #[must_use]
    pub fn duration(&self) -> f32 {
        self.duration
    }

    /// The planned motion of each axis; empty until the whole move is planned.
    #[must_use]
    pub fn trajectories(&self) -> &[Trajectory] {
        if self.is_planned() { &self.trajectories } else { &[] }
    }
}
