//! Checks that the encoder follows the command, and tells which fault it is if it does not.
//!
//! Encoder and command are compared over a stretch of travel, not at one instant: the load always lags behind its motor,
//! by an amount that depends on the speed but is far smaller than the error of a blocked motor. A joint is compared at each instant:
//! its encoder closes the loop of its own servo, so that only the lag of that loop is to be told from a joint that is blocked.

use vergence_protocol::{Counts, FaultCode, Micro};

use crate::settings::AxisSettings;

/// Number of counts by which an encoder at rest may flicker.
const FLICKER: u32 = 2;
/// Over a stretch, encoder and motor may differ by the travelled distance divided by this.
const SLIP_SHARE: i64 = 8;

/// Ticks without motion after which a joint that is behind its command counts as blocked.
const STANDS_TICKS: u32 = 50;

/// A disagreement of encoder and command that is too large for lag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost {
    /// The most probable cause.
    pub code: FaultCode,
    /// Command minus encoder, or the encoder's jump, in micro-units.
    pub detail: i32,
}

/// Commanded and encoder position at one instant, in micro-units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Place {
    command: i64,
    encoder: i64,
}

/// State of the check for one axis since its drivers went on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Following {
    before: Option<(Place, Counts)>,
    /// Counts at the first tick.
    first: Counts,
    /// Whether the encoder has ever left `first`.
    alive: bool,
    /// Direction of the command: 1, -1, or 0 at rest.
    direction: i64,
    /// Start of the present stretch of travel.
    stretch: Place,
    /// Two places on the latest part of the stretch, the older one first.
    recent: [Place; 2],
    /// Counts at which a joint stands, and for how many ticks.
    stands_at: Counts,
    stands_for: u32,
}

impl Following {
    /// Checks one tick of a joint; returns the fault, if any.
    pub fn watch_joint(&mut self, axis: &AxisSettings, command: Micro, encoder: Micro, counts: Counts) -> Option<Lost> {
        if counts.0.wrapping_sub(self.stands_at.0).unsigned_abs() > FLICKER {
            (self.stands_at, self.stands_for) = (counts, 0);
        }
        self.stands_for = self.stands_for.saturating_add(1);
        let detail = command.0.saturating_sub(encoder.0);
        let code = if self.stands_for > STANDS_TICKS { FaultCode::Stall } else { FaultCode::FollowingError };
        (detail.unsigned_abs() > axis.following_error.0.unsigned_abs()).then_some(Lost { code, detail })
    }

    /// Checks one tick; returns the fault, if any.
    pub fn watch(&mut self, axis: &AxisSettings, command: Micro, encoder: Micro, counts: Counts) -> Option<Lost> {
        let now = Place { command: command.0.into(), encoder: encoder.0.into() };
        let (before, old_counts) = self.before.replace((now, counts)).unwrap_or_else(|| {
            self.first = counts;
            (now, counts)
        });
        self.alive |= counts.0.wrapping_sub(self.first.0).unsigned_abs() > FLICKER;
        let limit = i64::from(axis.following_error.0);
        let error = now.command - now.encoder;
        let lost = |code| Some(Lost { code, detail: i32::try_from(error).unwrap_or(i32::MAX) });

        let jump = axis.encoder().position_at(counts.0.wrapping_sub(old_counts.0)).0;
        if jump.unsigned_abs() > axis.largest_jump() {
            return Some(Lost { code: FaultCode::EncoderLost, detail: jump });
        }
        let direction = (now.command - before.command).signum();
        if direction == 0 || direction != self.direction {
            self.direction = direction;
            (self.stretch, self.recent) = (before, [before; 2]);
        }
        if direction != 0
            && let Some(code) = self.disagreement(axis, now, before)
        {
            return lost(code);
        }
        if error.abs() > limit { lost(FaultCode::FollowingError) } else { None }
    }

    fn disagreement(&mut self, axis: &AxisSettings, now: Place, before: Place) -> Option<FaultCode> {
        let limit = i64::from(axis.following_error.0);
        let [older, newer] = self.recent;
        if (now.command - newer.command).abs() >= limit / 8 {
            self.recent = [newer, now];
        }
        let travel = (now.command - self.stretch.command).abs();
        let apart = (travel - self.direction * (now.encoder - self.stretch.encoder)).abs();
        if apart > limit / 2 {
            // Over a way within the tolerance neither motor nor encoder can be blamed: the limit is below the lag.
            if travel <= i64::from(axis.tolerance.0) {
                return Some(FaultCode::FollowingError);
            }
            let (commanded, made) =
                ((now.command - older.command).abs(), self.direction * (now.encoder - older.encoder));
            return Some(self.blame(commanded, made));
        }
        // An axis that stands still in this tick is judged later: it may start to move.
        let stands = 4 * self.direction * (now.encoder - before.encoder) < (now.command - before.command).abs();
        if travel < 2 * limit || stands {
            return None;
        }
        self.stretch = now;
        (apart > travel / SLIP_SHARE).then_some(FaultCode::Slip)
    }

    /// The cause of a disagreement: the encoder moved by `made` while the axis was `commanded` to move.
    fn blame(&self, commanded: i64, made: i64) -> FaultCode {
        if 4 * made < -commanded {
            FaultCode::WrongDirection
        } else if 4 * made >= commanded {
            FaultCode::Slip
        } else if self.alive {
            FaultCode::Stall
        } else {
            FaultCode::EncoderLost
        }
    }
}
