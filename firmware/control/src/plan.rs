//! Planning the move of one axis.

use vergence_protocol::Micro;

use crate::profile::Limits;
use crate::trajectory::{FINE_BITS, Fine, MotionState, Trajectory};

/// The properties of an axis that decide how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlanner {
    /// Limits at full speed.
    pub limits: Limits,
    /// Distance below the target from which the last approach comes, so that it takes up the play; zero where there is none.
    pub backlash: Micro,
}

/// The state from which a move is planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanStart {
    /// Position, velocity and acceleration of the command.
    pub motion: MotionState,
    /// Whether the axis rests with its play taken up from below: after a planned move, not after arming or homing.
    pub from_below: bool,
}

impl AxisPlanner {
    /// The quickest motion from `start` to `target` that takes at least `at_least` seconds, at `share` of full speed. From
    /// rest, acceleration and jerk are scaled with the speed; in mid-move they stay full, to be able to brake.
    #[must_use]
    pub fn plan(&self, start: PlanStart, target: Micro, share: f32, at_least: f32) -> Trajectory {
        let (from, full) = (start.motion, self.limits);
        let limits = if from.is_rest() { full.scaled(share) } else { Limits { speed: full.speed * share, ..full } };
        let [target, run_up] = [target, self.backlash].map(|micro| Fine::from(micro.0) << FINE_BITS);
        if run_up == 0 || self.takes_up_play(start, target, run_up) {
            return Trajectory::reach(from, target, limits, at_least);
        }
        Trajectory::reach_from_below(from, (target, run_up), [limits, full.scaled(share)], at_least)
    }

    /// Whether a straight motion ends with the play taken up from below.
    fn takes_up_play(&self, start: PlanStart, target: Fine, run_up: Fine) -> bool {
        let from = start.motion;
        let already_there = from.is_rest() && from.position == target && start.from_below;
        already_there || Trajectory::stop(from, self.limits).target() <= target - run_up
    }
}
