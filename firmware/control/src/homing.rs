//! Homing of one axis: seeks the switch, retracts, approaches slowly, compares, and moves to the nearest end of the range.
//!
//! The edge found slowly is the reference; the edge found fast only checks it (as in Klipper and GRBL).

use vergence_protocol::{Counts, FaultCode, Micro};

use crate::TICK_US;
use crate::axis::Axis;
use crate::contact::{Contact, DEBOUNCE_TICKS};
use crate::io::RigIo;
use crate::trajectory::{MotionState, Trajectory, fine, micro};

/// Number of ticks at rest after which a switch that still chatters counts as stuck.
pub const LONGEST_LOOK_TICKS: u8 = 200;

/// Phase of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// At rest: waits for the debounced switch, for at most `left` more ticks.
    Look { left: u8 },
    /// Leaves the switch, which was closed at the start.
    BackOff,
    /// Moves to the end that is home until the switch is operated.
    Seek,
    /// Brakes after the switch was found at `edge`.
    Brake { edge: Counts },
    /// Leaves the switch again.
    Retract { edge: Counts },
    /// Approaches the switch slowly.
    Approach { edge: Counts },
    /// Brakes after the switch was found again at `edge`.
    Rest { edge: Counts },
    /// Moves to the end of the range.
    Enter,
    /// Finished.
    Done,
}

/// Result of one tick of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    Running,
    Done,
    Failed { code: FaultCode, detail: i32 },
}

/// Homing of one axis.
#[derive(Clone, Copy, Debug)]
pub struct Homing {
    phase: Phase,
    contact: Contact,
}

impl Homing {
    /// Starts homing of an axis at rest.
    pub fn start() -> Self {
        Self { phase: Phase::Look { left: LONGEST_LOOK_TICKS }, contact: Contact::default() }
    }

    /// Runs one tick.
    pub fn poll(&mut self, axis: &mut Axis, io: &impl RigIo) -> Progress {
        let homing = axis.settings.homing;
        let sign = axis.settings.switches.home_end.sign();
        let limits = axis.settings.limits_at(homing.seek_speed);
        let moving = axis.is_moving();
        let counts = axis.counts(io);
        self.contact.read(axis.home_switch(io), counts);
        let closed = self.contact.is_closed() == Some(true);
        let edge_now = self.contact.edge();
        self.phase = match self.phase {
            Phase::Look { left } if self.contact.is_closed().is_none() => match left.checked_sub(1) {
                Some(left) => Phase::Look { left },
                None => return stuck(0),
            },
            Phase::Look { .. } if closed => {
                axis.travel(Micro(-sign * back_off(axis)), limits);
                Phase::BackOff
            }
            Phase::BackOff if moving => Phase::BackOff,
            Phase::BackOff if closed => return stuck(back_off(axis)),
            Phase::Look { .. } | Phase::BackOff => {
                axis.travel(Micro(sign * homing.travel.0), limits);
                Phase::Seek
            }
            Phase::Seek => match edge_now {
                Some(edge) => {
                    axis.stop();
                    Phase::Brake { edge }
                }
                None if moving => Phase::Seek,
                None => return not_found(homing.travel.0),
            },
            Phase::Brake { edge } if moving => Phase::Brake { edge },
            Phase::Brake { edge } => {
                let overshoot = axis.settings.encoder().position_at(edge.0.wrapping_sub(counts.0));
                axis.travel(Micro((-sign * homing.retract.0).saturating_add(overshoot.0)), limits);
                Phase::Retract { edge }
            }
            Phase::Retract { edge } if moving => Phase::Retract { edge },
            Phase::Retract { .. } if closed => return stuck(homing.retract.0),
            Phase::Retract { edge } => {
                let slow = axis.settings.limits_at(homing.approach_speed);
                axis.travel(Micro((sign * homing.retract.0).saturating_mul(2)), slow);
                Phase::Approach { edge }
            }
            Phase::Approach { edge } => match edge_now {
                Some(slow_edge) => {
                    let apart = axis.settings.encoder().position_at(slow_edge.0.wrapping_sub(edge.0)).0;
                    if apart.abs() > homing.repeatability.0 {
                        return Progress::Failed { code: FaultCode::HomeNotRepeatable, detail: apart };
                    }
                    axis.stop();
                    Phase::Rest { edge: slow_edge }
                }
                None if moving => Phase::Approach { edge },
                None => return not_found(homing.retract.0.saturating_mul(2)),
            },
            Phase::Rest { edge } if moving => Phase::Rest { edge },
            Phase::Rest { edge } => {
                axis.reference(io, edge, homing.switch_at);
                axis.go_to(axis.settings.home_position(), limits);
                Phase::Enter
            }
            Phase::Enter if moving => Phase::Enter,
            Phase::Enter | Phase::Done => Phase::Done,
        };
        if self.phase == Phase::Done { Progress::Done } else { Progress::Running }
    }
}

/// Distance that leaves the switch from the farthest place at which a search can have come to rest beyond it. A search
/// that was still accelerating when it was stopped travels on for the time a/j at no more than its speed; it was stopped
/// only when the contact was debounced.
fn back_off(axis: &Axis) -> i32 {
    axis.settings.homing.retract.0.saturating_add(run_out(axis) as i32)
}

/// Way of a search from the edge of its switch until it rests; it also gets its speed on it.
pub fn run_out(axis: &Axis) -> f32 {
    let limits = axis.settings.limits_at(axis.settings.homing.seek_speed);
    let at_speed = MotionState { velocity: fine(limits.speed), ..MotionState::default() };
    let braking = micro(Trajectory::stop(at_speed, limits).target()) + limits.speed * limits.acceleration / limits.jerk;
    let unsure = limits.speed * f32::from(DEBOUNCE_TICKS) * TICK_US as f32 * 1e-6;
    braking + unsure
}

fn stuck(distance: i32) -> Progress {
    Progress::Failed { code: FaultCode::HomeSwitchStuck, detail: distance }
}

fn not_found(distance: i32) -> Progress {
    Progress::Failed { code: FaultCode::HomeSwitchNotFound, detail: distance }
}
