//! Homing against an end stop, found by StallGuard of a TMC2209 and confirmed by the encoder (datasheet rev. 1.09, sections
//! 11 and 15.4).
//!
//! The driver reports a stall, and the motor goes on pressing until the encoder has stood still for half of
//! `following_error`: a report without that is a false one. Both approaches have the speed for which the threshold was
//! chosen, because StallGuard depends on it. The reference is the furthest count of an approach: there the end stop took the
//! whole force of the motor.

use vergence_protocol::{Counts, FaultCode, Micro};

use crate::axis::Axis;
use crate::contact::Contact;
use crate::follow::Lost;
use crate::homing::{LONGEST_LOOK_TICKS, Progress, run_out};
use crate::io::RigIo;
use crate::switches::way_to_judge;

/// Ticks in which a load comes to rest after its motor was stopped at once.
const REST_TICKS: u8 = 100;

/// Phase of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// At rest: the driver must not report a stall.
    Look { left: u8 },
    /// Approaches the end stop, or presses against it.
    Approach,
    /// The motor was stopped at the end stop: waits until the load rests.
    Settle { left: u8 },
    /// Leaves the end stop, so that the next approach gets its speed.
    Retract,
    /// Moves to the end of the range.
    Enter,
    /// Finished.
    Done,
}

/// Homing of one axis against its end stop.
#[derive(Clone, Copy, Debug)]
pub struct StallHoming {
    phase: Phase,
    contact: Contact,
    /// Whether the encoder was found not to follow in this tick.
    stands: bool,
    /// Command at which the driver reported a stall in this approach, in micro-units.
    reported: Option<i32>,
    /// Whether the axis stood at its end stop from the beginning.
    began_there: bool,
    /// Furthest count of this approach, and of the one before.
    furthest: Option<Counts>,
    first: Option<Counts>,
}

impl StallHoming {
    /// Starts homing of an axis at rest.
    pub fn start() -> Self {
        Self {
            phase: Phase::Look { left: LONGEST_LOOK_TICKS },
            contact: Contact::default(),
            stands: false,
            reported: None,
            began_there: false,
            furthest: None,
            first: None,
        }
    }

    /// Takes a disagreement of encoder and command; returns whether it is that of a load at its end stop. It bounds the way
    /// of the press: half of `following_error`.
    pub fn takes(&mut self, lost: &Lost) -> bool {
        self.stands = self.phase == Phase::Approach
            && match lost.code {
                FaultCode::Stall | FaultCode::Slip | FaultCode::FollowingError => true,
                // A rotor that loses its step falls back by four full steps.
                FaultCode::WrongDirection => self.reported.is_some(),
                // Until now it may have had no reason to count.
                FaultCode::EncoderLost => !self.began_there && self.reported.is_none(),
                _ => false,
            };
        self.stands
    }

    /// Runs one tick.
    pub fn poll(&mut self, axis: &mut Axis, io: &impl RigIo) -> Progress {
        let sign = axis.settings.switches.home_end.sign();
        let homing = axis.settings.homing;
        let limits = axis.settings.limits_at(homing.seek_speed);
        let counts = axis.counts(io);
        let is_further = |before: Counts| (counts.0.wrapping_sub(before.0) * sign).is_positive();
        if self.furthest.is_none_or(is_further) {
            self.furthest = Some(counts);
        }
        self.phase = match self.phase {
            Phase::Look { left } => {
                self.contact.read(axis.home_switch(io), counts);
                match (self.contact.is_closed(), left.checked_sub(1)) {
                    (None, Some(left)) => Phase::Look { left },
                    (Some(false), _) => {
                        axis.travel(Micro(sign * homing.travel.0), limits);
                        Phase::Approach
                    }
                    _ => return failed(FaultCode::HomeSwitchStuck, 0),
                }
            }
            Phase::Approach => match self.approach(axis, io) {
                Ok(phase) => phase,
                Err(code) => {
                    let pressed = self.reported.map_or(0, |at| axis.commanded().0.saturating_sub(at));
                    return failed(code, if code == FaultCode::HomeSwitchNotFound { homing.travel.0 } else { pressed });
                }
            },
            Phase::Settle { left } => {
                axis.rest_at_encoder(io);
                match left.checked_sub(1) {
                    Some(left) => Phase::Settle { left },
                    None => match self.settled(axis, io) {
                        Ok(phase) => phase,
                        Err(apart) => return failed(FaultCode::HomeNotRepeatable, apart),
                    },
                }
            }
            Phase::Retract if axis.is_moving() => Phase::Retract,
            Phase::Retract => {
                (self.furthest, self.reported) = (None, None);
                // A first approach that began at the end stop is made anew.
                let way = if self.first.is_some() { 2 * run_up(axis) } else { homing.travel.0 };
                axis.travel(Micro(sign.saturating_mul(way)), limits);
                Phase::Approach
            }
            Phase::Enter if axis.is_moving() => Phase::Enter,
            Phase::Enter | Phase::Done => Phase::Done,
        };
        if self.phase == Phase::Done { Progress::Done } else { Progress::Running }
    }

    /// One tick on the way to the end stop and against it.
    fn approach(&mut self, axis: &mut Axis, io: &impl RigIo) -> Result<Phase, FaultCode> {
        let stall = axis.reads_stall(io);
        let commanded = axis.commanded().0;
        if stall && self.reported.is_none() {
            self.reported = Some(commanded);
        }
        if core::mem::take(&mut self.stands) {
            // Braking would press on: a motor that has lost its step may be stopped at once.
            axis.rest_at_encoder(io);
            let was_judged = axis.stall_may_be_judged();
            return match self.reported {
                Some(_) => Ok(Phase::Settle { left: REST_TICKS }),
                None if was_judged => Err(FaultCode::StallMissed),
                None if self.began_there || self.first.is_some() => Err(FaultCode::Stall),
                None => {
                    self.began_there = true;
                    Ok(Phase::Settle { left: REST_TICKS })
                }
            };
        }
        let pressed = self.reported.map_or(0, |at| commanded.saturating_sub(at).abs());
        if pressed > axis.settings.following_error.0 {
            return Err(FaultCode::DriverStall);
        }
        if axis.is_moving() { Ok(Phase::Approach) } else { Err(FaultCode::HomeSwitchNotFound) }
    }

    /// What follows an approach that has ended at rest; the error is how far two approaches are apart.
    fn settled(&mut self, axis: &mut Axis, io: &impl RigIo) -> Result<Phase, i32> {
        let homing = axis.settings.homing;
        let limits = axis.settings.limits_at(homing.seek_speed);
        let found = self.furthest.filter(|_| self.reported.is_some());
        if let (Some(first), Some(edge)) = (self.first, found) {
            let apart = axis.settings.encoder().position_at(edge.0.wrapping_sub(first.0)).0;
            if apart.abs() > homing.repeatability.0 {
                return Err(apart);
            }
            axis.reference(io, edge, homing.switch_at);
            axis.go_to(axis.settings.home_position(), limits);
            return Ok(Phase::Enter);
        }
        self.first = found;
        axis.travel(Micro(-axis.settings.switches.home_end.sign() * run_up(axis)), limits);
        Ok(Phase::Retract)
    }
}

/// Way in which an approach from rest gets its speed and a stall can be noticed.
fn run_up(axis: &Axis) -> i32 {
    let homing = axis.settings.homing;
    let speed = axis.settings.limits_at(homing.seek_speed).speed;
    homing.retract.0.saturating_add((run_out(axis) + way_to_judge(speed)) as i32)
}

fn failed(code: FaultCode, detail: i32) -> Progress {
    Progress::Failed { code, detail }
}
