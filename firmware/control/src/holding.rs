//! The holding current: motors that rest for long need less current than motors that move.

use vergence_protocol::Microseconds;

use crate::io::RigIo;

/// Since when the motors rest, and whether they have their holding current.
#[derive(Clone, Copy, Debug, Default)]
pub struct Holding {
    /// Time at rest in microseconds after which they get it; 0 for never.
    after_us: u64,
    rest_since: Option<Microseconds>,
    is_held: bool,
}

impl Holding {
    /// Sets the time at rest in microseconds; 0 for never.
    pub fn set_after(&mut self, after_us: u64) {
        self.after_us = after_us;
    }

    /// Takes note at `now` of whether the motors with their drivers on rest, and have rested since the last call. Call it
    /// before the first step of a motion is due.
    pub fn poll(&mut self, now: Microseconds, at_rest: bool, io: &mut impl RigIo) {
        self.rest_since = if at_rest { self.rest_since.or(Some(now)) } else { None };
        let holds = self.after_us > 0 && self.rest_since.is_some_and(|since| now.0 - since.0 >= self.after_us);
        if holds != self.is_held {
            self.is_held = holds;
            io.set_holding(holds);
        }
    }
}
