//! How often results come, and what keeps them from coming more often.

use std::collections::VecDeque;

use vergence_pipeline::SkipReason;

use crate::totals::Totals;

/// Exposures over whose time the rate is taken.
const KEPT: usize = 16;

/// What keeps results from coming more often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Every exposure is measured.
    Cameras,
    /// Exposures are skipped, because newer ones come while one is measured.
    Matching,
}

impl Limit {
    /// The name in reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Cameras => "cameras",
            Self::Matching => "matching",
        }
    }
}

/// The latest results of a live loop.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    /// When each was exposed, in microseconds, and how many exposures had been skipped for newer ones.
    latest: VecDeque<(f64, u64)>,
}

impl Pace {
    /// Takes one more result, exposed at `exposed_us` microseconds, with the counts so far. Results per second, and what limits them; `None` with the first one.
    pub fn note(&mut self, exposed_us: f64, totals: &Totals) -> Option<(f64, Limit)> {
        let skipped = totals.skipped.get(&SkipReason::NewerCame).copied().unwrap_or_default();
        self.take(exposed_us, skipped)
    }

    fn take(&mut self, exposed_us: f64, skipped: u64) -> Option<(f64, Limit)> {
        if self.latest.len() == KEPT {
            self.latest.pop_front();
        }
        let first = self.latest.front().copied();
        self.latest.push_back((exposed_us, skipped));
        let (since, skipped_before) = first?;
        let rate = (self.latest.len() - 1) as f64 / ((exposed_us - since) * 1e-6);
        let limit = if skipped > skipped_before { Limit::Matching } else { Limit::Cameras };
        rate.is_finite().then_some((rate, limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_latest_results() {
        let mut pace = Pace::default();
        assert_eq!(pace.take(0.0, 0), None);
        let at = |pace: &mut Pace, n: u32, period: f64, skipped| pace.take(f64::from(n) * period, skipped);
        for n in 1..40 {
            let Some((rate, limit)) = at(&mut pace, n, 100_000.0, 0) else { panic!("two results have a rate") };
            assert!((rate - 10.0).abs() < 1e-6 && limit == Limit::Cameras, "{n}: {rate}");
        }
        // Every second exposure is skipped from now on: after a while the rate is half of what it was.
        let mut last = None;
        for n in 20..60 {
            last = at(&mut pace, n, 200_000.0, u64::from(n));
        }
        let Some((rate, limit)) = last else { panic!("a rate") };
        assert!((rate - 5.0).abs() < 1e-6 && limit == Limit::Matching, "{rate}");
    }
}
