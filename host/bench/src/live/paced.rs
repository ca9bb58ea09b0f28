//! Pairs that come as often as cameras deliver them.

/// Pairs of which those that come while one is measured are skipped but for the newest, as in the live loop. When they come is reckoned, so that
/// nobody waits.
#[derive(Clone, Debug)]
pub(super) struct Paced {
    rate: f64,
    count: usize,
    next: usize,
    exposed: f64,
    now: f64,
}

impl Paced {
    /// `count` pairs, of which `rate` come in a second.
    pub const fn new(rate: f64, count: usize) -> Self {
        Self { rate, count, next: 0, exposed: 0.0, now: 0.0 }
    }

    /// The number of the newest pair that has come, or of the next one; `None` after the last.
    pub fn next(&mut self) -> Option<usize> {
        let last = self.count.checked_sub(1).filter(|_| self.next < self.count)?;
        let newest = ((self.now * self.rate) as usize).clamp(self.next, last);
        self.next = newest + 1;
        self.exposed = newest as f64 / self.rate;
        Some(newest)
    }

    /// Measuring that pair took so many seconds: its delay.
    pub const fn took(&mut self, seconds: f64) -> f64 {
        self.now = self.now.max(self.exposed) + seconds;
        self.now - self.exposed
    }

    /// Seconds from the first pair to the last result.
    pub const fn seconds(&self) -> f64 {
        self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_of_the_pairs_that_came_is_measured() {
        let mut paced = Paced::new(10.0, 6);
        let mut measured = |seconds: f64| (paced.next(), (1e3 * paced.took(seconds)).round() as u32);
        // 0 to 150 ms; 1 waits until then; 3 has come at 310 ms and 2 is skipped; 4 waits for nobody.
        let seconds = [0.150, 0.160, 0.050, 0.040, 0.250];
        let found = seconds.map(&mut measured);
        assert_eq!(found.map(|(number, _)| number), [Some(0), Some(1), Some(3), Some(4), Some(5)]);
        assert_eq!(found.map(|(_, delay)| delay), [150, 210, 60, 40, 250]);
        assert_eq!((paced.next(), (1e3 * paced.seconds()).round() as u32), (None, 750));
    }
}
