//! The clock of a board, as the true time shows it: every time that a board states must fit one offset.

/// Bounds of the true time minus the board's time, in microseconds, since the board's start.
#[derive(Clone, Copy, Debug)]
pub struct BoardClock {
    least: i64,
    most: i64,
}

impl Default for BoardClock {
    fn default() -> Self {
        Self { least: i64::MIN / 2, most: i64::MAX / 2 }
    }
}

impl BoardClock {
    /// Notes that the board's time `at` lay between two true times; returns the contradiction to what was noted before.
    pub fn note(&mut self, at: u64, earliest: u64, latest: u64) -> Option<String> {
        let least = self.least.max(earliest as i64 - at as i64);
        let most = self.most.min(latest as i64 - at as i64);
        if least > most {
            return Some(format!("time {at} lies {} us beside what the board said before", least - most));
        }
        (self.least, self.most) = (least, most);
        None
    }

    /// Notes that the board's time `at` was not after the true time `latest`.
    pub fn note_before(&mut self, at: u64, latest: u64) -> Option<String> {
        self.note(at, 0, latest)
    }

    /// The true times at which the board's time may have been `at`.
    pub fn when(&self, at: u64) -> [i64; 2] {
        [at as i64 + self.least, at as i64 + self.most]
    }
}
