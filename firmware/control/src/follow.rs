//! Does the encoder follow the command? And if not, which of the two is to be blamed.
//!
//! The disagreement of encoder and command over a stretch of travel is watched, not at one instant: the load lags behind
//! its motor by an amount that changes with the speed, and by far less than a motor that stands.

use vergence_protocol::{Counts, FaultCode, Micro};

use crate::settings::AxisSettings;

/// Counts that an encoder at rest may flicker by.
const FLICKER: u32 = 2;
/// A stretch that was travelled is in order where encoder and motor differ by less than one part in so many.
const SLIP_SHARE: i64 = 8;

/// A disagreement that no longer passes for lag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost {
    /// What it looks like.
    pub code: FaultCode,
    /// Command less encoder, or how far the encoder jumped, in micro-units.
    pub detail: i32,
}

/// Command and encoder at one instant, micro-units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Place {
    command: i64,
    encoder: i64,
}

/// What is remembered of one axis since its drivers went on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Following {
    before: Option<(Place, Counts)>,
    /// Counts when the watch began; whether the encoder has ever left them.
    first: Counts,
    alive: bool,
    /// Way of the command: up, down or not at all.
    direction: i64,
    /// Begin of the watched stretch of travel.
    stretch: Place,
    /// Two places on the latest part of it, the older first.
    recent: [Place; 2],
}

impl Following {
    /// Takes one tick.
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
            && let Some(code) = self.disagreement(now, before, limit)
        {
            return lost(code);
        }
        if error.abs() > limit { lost(FaultCode::FollowingError) } else { None }
    }

    fn disagreement(&mut self, now: Place, before: Place, limit: i64) -> Option<FaultCode> {
        let [older, newer] = self.recent;
        if (now.command - newer.command).abs() >= limit / 8 {
            self.recent = [newer, now];
        }
        let travel = (now.command - self.stretch.command).abs();
        let apart = (travel - self.direction * (now.encoder - self.stretch.encoder)).abs();
        if apart > limit / 2 {
            let (commanded, made) =
                ((now.command - older.command).abs(), self.direction * (now.encoder - older.encoder));
            return Some(self.blame(commanded, made));
        }
        // Who stands just now is judged when that has lasted.
        let stands = 4 * self.direction * (now.encoder - before.encoder) < (now.command - before.command).abs();
        if travel < 2 * limit || stands {
            return None;
        }
        self.stretch = now;
        (apart > travel / SLIP_SHARE).then_some(FaultCode::Slip)
    }

    /// `made` of what was lately `commanded`.
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
