//! The camera trigger: single pulses, or pulses at a period that does not drift.

use vergence_protocol::{AxisList, Counts, Microseconds, Refusal, Trigger, TriggerMark};

use crate::TICK_US;
use crate::io::RigIo;

/// Shortest period in microseconds: no camera of the rig is faster at full size, and the line must carry a `TriggerMark`
/// for each pulse.
const SHORTEST_PERIOD_US: u32 = 2_000;
/// Longest period in microseconds: slower triggers are fired one by one.
const LONGEST_PERIOD_US: u32 = 10_000_000;

/// Fires the cameras and numbers the pulses.
#[derive(Debug, Default)]
pub struct CameraTrigger {
    /// Period in microseconds, and time of the next pulse not yet ordered.
    train: Option<(u64, Microseconds)>,
    seq: u32,
}

impl CameraTrigger {
    /// Sets the trigger and numbers its pulses from 0.
    ///
    /// # Errors
    /// [`Refusal::Invalid`] if the period is too short or too long; the trigger goes on as before.
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

    /// Whether periodic pulses are on.
    pub fn is_running(&self) -> bool {
        self.train.is_some()
    }

    /// Orders the pulse that is due before the next tick, if any. Pulses that come too late are left out; the others keep
    /// their times.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let Some((period, next)) = &mut self.train else { return };
        let missed = now.0.saturating_sub(next.0).div_ceil(*period);
        next.0 += missed * *period;
        if next.0 < now.0 + TICK_US {
            io.fire_trigger(*next);
            next.0 += *period;
        }
    }

    /// Numbers the pulse at `at` and returns its report for the host.
    pub fn mark(&mut self, at: Microseconds, counts: AxisList<Counts>) -> TriggerMark {
        let mark = TriggerMark { seq: self.seq, at, counts };
        self.seq = self.seq.wrapping_add(1);
        mark
    }
}
