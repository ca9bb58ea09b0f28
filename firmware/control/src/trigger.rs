//! The camera trigger: pulses on a grid that does not drift.

use vergence_protocol::{AxisList, Counts, FrameMark, Microseconds, Refusal, Trigger};

use crate::TICK_US;
use crate::io::RigIo;

/// No camera of the rig is faster at full size, and every pulse must fit the line as a `FrameMark`.
const SHORTEST_PERIOD_US: u32 = 2_000;
/// A slower trigger is fired one by one.
const LONGEST_PERIOD_US: u32 = 10_000_000;

/// Fires the cameras and numbers the pulses.
#[derive(Debug, Default)]
pub struct CameraTrigger {
    /// Period in microseconds and the next pulse not yet ordered.
    train: Option<(u64, Microseconds)>,
    seq: u32,
}

impl CameraTrigger {
    /// Begins anew.
    ///
    /// # Errors
    /// [`Refusal::Invalid`] where the period is too short or too long; the trigger goes on as it was.
    pub fn set(&mut self, now: Microseconds, trigger: Trigger, io: &mut impl RigIo) -> Result<(), Refusal> {
        let train = match trigger {
            Trigger::Off | Trigger::Once => None,
            Trigger::Every { period_us } if (SHORTEST_PERIOD_US..=LONGEST_PERIOD_US).contains(&period_us) => {
                let period = u64::from(period_us);
                Some((period, Microseconds(now.0 + period)))
            }
            Trigger::Every { .. } => return Err(Refusal::Invalid),
        };
        *self = Self { train, seq: 0 };
        if trigger != Trigger::Off {
            io.fire_trigger(now);
        }
        Ok(())
    }

    /// Whether pulses will come by themselves.
    pub fn is_running(&self) -> bool {
        self.train.is_some()
    }

    /// Orders the pulses that are due before the next tick. One that came too late is left out: the grid stays.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let Some((period, next)) = &mut self.train else { return };
        let missed = now.0.saturating_sub(next.0).div_ceil(*period);
        next.0 += missed * *period;
        if next.0 < now.0 + TICK_US {
            io.fire_trigger(*next);
            next.0 += *period;
        }
    }

    /// What the host is told of a pulse.
    pub fn mark(&mut self, at: Microseconds, counts: AxisList<Counts>) -> FrameMark {
        let mark = FrameMark { seq: self.seq, at, counts };
        self.seq = self.seq.wrapping_add(1);
        mark
    }
}
