//! Compares the instants of step pulses.

use std::collections::VecDeque;

use vergence_protocol::{ControllerState, MoveId, PoseReport};

use super::compare::Apart;
use super::difference::{Difference, Figures};

/// The list of a tick runs so much later on the chip, in nanoseconds.
const LATE_NS: i64 = 20_000;
/// Longest time between two steps that counts as their distance, in nanoseconds.
const LONGEST_NS: u64 = 60_000_000;
/// Longest time in microseconds from the turn of one motor to that of the other: with targets some steps apart, one makes some
/// steps more before it turns.
const TURNING_US: f64 = 30_000.0;

/// The phases of a motion whose step instants are compared; each has its bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// An axis searches its home switch.
    Homing,
    /// At constant speed.
    Steady,
    /// Speeding up or braking.
    Changing,
    /// After a new target in mid-move.
    Retargeted,
    /// Braking because of a request, a fault or the end of the lease.
    Stopping,
}

impl Phase {
    /// Every phase.
    pub const ALL: [Self; 5] = [Self::Homing, Self::Steady, Self::Changing, Self::Retargeted, Self::Stopping];

    /// The name of the phase.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Homing => "homing",
            Self::Steady => "constant speed",
            Self::Changing => "acceleration",
            Self::Retargeted => "new target",
            Self::Stopping => "stop",
        }
    }

    /// Largest difference of the instants of a step, in microseconds. Where targets are some steps apart, the time of these
    /// steps is added.
    #[must_use]
    pub const fn bound_us(self) -> f64 {
        match self {
            Self::Homing | Self::Steady => 5.0,
            Self::Changing | Self::Retargeted | Self::Stopping => 25.0,
        }
    }
}

/// What the native board was doing.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Its latest pose.
    pub pose: Option<&'a PoseReport>,
    /// Whether the axis goes at a constant speed.
    pub steady: bool,
    /// Steps by which the way back from the home switch may differ: it is counted by the encoder, which lags in the fast
    /// search.
    pub steps_back: f64,
}

/// The steps of one axis since its last rest.
#[derive(Clone, Debug, Default)]
pub struct Steps {
    last_ns: Option<u64>,
    interval_ns: u64,
    first_move: Option<MoveId>,
    /// Whether the axis has searched downwards, and whether it has gone back upwards since.
    searched: bool,
    went_back: bool,
    /// Whether the boards make different steps from here on.
    apart: bool,
}

impl Steps {
    /// Whether the boards have seen a switch or an encoder at different ticks.
    pub fn is_apart(&self) -> bool {
        self.apart
    }

    /// Whether the axis has gone back from its home switch.
    pub fn went_back(&self) -> bool {
        self.went_back
    }

    /// Compares the steps that both boards have made: native first.
    pub fn compare(
        &mut self,
        axis: usize,
        [native, chip]: [&mut VecDeque<(u64, bool)>; 2],
        Moment { pose, steady, steps_back }: Moment<'_>,
        apart: Apart,
        target_steps: f64,
        figures: &mut Figures,
    ) -> Result<(), Difference> {
        while let (Some(&ours), Some(&theirs)) = (native.front(), chip.front()) {
            if self.apart {
                native.clear();
                chip.clear();
                return Ok(());
            }
            native.pop_front();
            chip.pop_front();
            let phase = self.phase(ours.0, pose, steady);
            let us = (theirs.0 as i64 - ours.0 as i64 - LATE_NS) as f64 * 1e-3;
            let goes_back = apart.homing && self.goes_back(ours.1);
            let differing = if goes_back { target_steps.max(steps_back) } else { target_steps };
            // Where the speed changes, the next steps may be twice as far apart as these.
            let stretched = if matches!(phase, Phase::Homing | Phase::Steady) { 1.0 } else { 2.0 };
            let apart_us = stretched * differing * self.interval_ns as f64 * 1e-3;
            let turns = ours.1 != theirs.1 && target_steps > 0.0 && us.abs() < TURNING_US;
            let late_us = if apart.late { 200.0 } else { 0.0 };
            if ours.1 == theirs.1 && us.abs() <= phase.bound_us() + apart_us + late_us {
                figures.steps += 1;
                if !apart.late {
                    figures.note_step(phase, us.abs(), self.interval_ns as f64 * 1e-3);
                }
            } else if apart.homing || apart.in_faults() || turns {
                self.apart = true;
            } else {
                let field = format!("instant of a step of axis {axis}, {}, us", phase.name());
                let named = |(at, forward): (u64, bool)| (at as f64 * 1e-3, if forward { "up" } else { "down" });
                return Err(Difference::new(field, named(ours), named(theirs)));
            }
        }
        Ok(())
    }

    /// Notes the direction of a step in homing; returns whether it belongs to the way back from the switch or to what follows.
    fn goes_back(&mut self, forward: bool) -> bool {
        self.went_back |= forward && self.searched;
        self.searched |= !forward;
        self.went_back
    }

    fn phase(&mut self, at_ns: u64, pose: Option<&PoseReport>, steady: bool) -> Phase {
        let interval = self.last_ns.map_or(LONGEST_NS, |last| at_ns.saturating_sub(last).min(LONGEST_NS));
        (self.last_ns, self.interval_ns) = (Some(at_ns), interval);
        let Some(pose) = pose else { return Phase::Changing };
        let first = *self.first_move.get_or_insert(pose.move_id);
        match pose.state {
            ControllerState::Homing => Phase::Homing,
            ControllerState::Moving if pose.move_id != first => Phase::Retargeted,
            ControllerState::Moving if steady => Phase::Steady,
            ControllerState::Moving => Phase::Changing,
            _ => Phase::Stopping,
        }
    }
}
