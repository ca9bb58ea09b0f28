//! Plans of moves: asked for here, made elsewhere below the control tick, and begun at a tick that is fixed beforehand.
//!
//! A plan takes longer than a tick. It therefore starts from the state in which the axes will be [`plan_ticks`] ticks after
//! the request; until then the axes go on as before, or rest. Whatever changes their motion meanwhile (a stop, a fault)
//! drops the plan, and a plan that comes too late is asked for again with more time.

use vergence_protocol::{AxisList, Micro};

use super::Controller;
use crate::move_planner::{MovePlanner, PlanRequest};

/// Ticks from a request to the begin of its plan for so many axes, of which each is planned by itself: twice what planning takes
/// on the slowest board beside two axes at 100 kHz (`tests/hil_planning.rs`).
#[must_use]
pub const fn plan_ticks(axes: usize) -> u32 {
    const OF_EACH: u32 = 4;
    const AT_LEAST: u32 = 8;
    let ticks = (axes as u32).saturating_mul(OF_EACH);
    if ticks > AT_LEAST { ticks } else { AT_LEAST }
}

/// Largest number of ticks that a plan gets after it came too late.
const MOST_TICKS: u32 = 64;

/// A plan that is being made.
#[derive(Clone, Debug)]
pub(super) struct Planning {
    number: u32,
    targets: AxisList<Micro>,
    /// Share of full speed.
    share: f32,
    /// Whether the request was taken.
    is_taken: bool,
    /// Whether the target has changed since: then this plan bridges the time in which the next one is made.
    is_outdated: bool,
    /// Ticks from the request to the begin of the plan, and how many of them are left.
    ticks: u32,
    left: u32,
}

impl Controller {
    /// Takes the request for a plan, if there is one. Plan it by [`MovePlanner`], apart from the control tick, and return it
    /// by [`Self::give_plan`]. A newer request replaces those before it.
    pub fn take_plan_request(&mut self) -> Option<PlanRequest> {
        let planning = self.planning.as_mut().filter(|planning| !planning.is_taken)?;
        planning.is_taken = true;
        let Planning { number, left, share, ref targets, .. } = *planning;
        let ways = self.axes.iter().zip(targets).map(|(axis, &target)| axis.way(left, target));
        let mut request = PlanRequest { number, share, ways: ways.collect() };
        if self.axes.iter().all(|axis| axis.settings.is_joint()) {
            request.straighten();
        }
        Some(request)
    }

    /// Takes a plan, which begins with the next tick. Returns false where it begins later: then give it again after the
    /// next tick. A plan that is not wanted any more, or does not begin where the axes are, is dropped.
    pub fn give_plan(&mut self, plan: &MovePlanner) -> bool {
        let number = plan.request().number;
        let Some(planning) = self.planning.as_ref().filter(|planning| planning.number == number) else { return true };
        if planning.left > 0 {
            return false;
        }
        let is_outdated = planning.is_outdated;
        let (ways, trajectories) = (&plan.request().ways, plan.trajectories());
        let begins_here = ways.iter().zip(&self.axes).all(|(way, axis)| way.start.motion == axis.state_after(0));
        if trajectories.len() == self.axes.len() && begins_here {
            for (axis, trajectory) in self.axes.iter_mut().zip(trajectories) {
                axis.run_planned(trajectory, plan.duration());
            }
            self.planning = None;
            if is_outdated {
                self.plan_within(plan_ticks(self.axes.len()));
            }
        }
        true
    }

    /// Makes the plan that begins with the next tick, if any, here and now. Call it after each tick on a board on which
    /// planning takes no time.
    pub fn plan_at_once(&mut self) {
        if self.planning.as_ref().is_some_and(|planning| planning.left == 0)
            && let Some(request) = self.take_plan_request()
        {
            self.give_plan(&MovePlanner::planned(request));
        }
    }

    /// Asks for a plan to the targets of the latest move. A plan under way is still begun, so that a host that changes its
    /// mind faster than plans are made does not keep the axes from following.
    pub(super) fn want_plan(&mut self) {
        match &mut self.planning {
            Some(planning) => planning.is_outdated = true,
            None => self.plan_within(plan_ticks(self.axes.len())),
        }
    }

    fn plan_within(&mut self, ticks: u32) {
        self.plans = self.plans.wrapping_add(1).max(1);
        let (targets, share) = (self.active.targets.clone(), self.active.share);
        let (number, is_taken, is_outdated) = (self.plans, false, false);
        self.planning = Some(Planning { number, targets, share, is_taken, is_outdated, ticks, left: ticks });
    }

    /// Counts a tick of the time that the plan has; a plan that has not come by then gets twice the time. Call it in each
    /// tick before the axes advance.
    pub(super) fn count_planning(&mut self) {
        let Some(planning) = &mut self.planning else { return };
        match planning.left.checked_sub(1) {
            Some(left) => planning.left = left,
            None => {
                let ticks = (2 * planning.ticks).min(MOST_TICKS);
                self.plan_within(ticks);
            }
        }
    }
}
