//! Measured ranges compared with the truth.

use vergence_vision::Length;

/// Points truly nearer than this are scored by themselves: the bench is built for them.
const NEAR: Length = Length::from_mm(1500.0);
/// Relative error of the range beyond which a point is an outlier.
const OUTLIER: f64 = 0.1;

/// Quantiles of the relative errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Number of points.
    pub points: usize,
    /// Median relative error.
    pub median: f64,
    /// 95th percentile of the relative error.
    pub p95: f64,
}

/// Relative errors of the range, |measured - true| / true.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// Errors of all points.
    pub all: Spread,
    /// Errors of the points truly within 1.5 m.
    pub near: Spread,
    /// Share of all points whose range is off by more than 10 %.
    pub outlier_fraction: f64,
}

/// Scores pairs of measured and true range. A point without a true range counts as an outlier of infinite error.
#[must_use]
pub fn score(ranges: &[(Length, Option<Length>)]) -> Score {
    let relative = |&(measured, truth): &(Length, Option<Length>)| {
        truth.map_or(f64::INFINITY, |truth| (measured.mm() / truth.mm() - 1.0).abs())
    };
    let all: Vec<f64> = ranges.iter().map(relative).collect();
    let near = ranges.iter().filter(|(_, truth)| truth.is_some_and(|truth| truth <= NEAR)).map(relative).collect();
    let outliers = all.iter().filter(|&&error| error > OUTLIER).count();
    let outlier_fraction = if all.is_empty() { 0.0 } else { outliers as f64 / all.len() as f64 };
    Score { all: spread(all), near: spread(near), outlier_fraction }
}

fn spread(mut errors: Vec<f64>) -> Spread {
    errors.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let index = (errors.len() as f64 * share).ceil() as usize;
        errors.get(index.saturating_sub(1)).copied().unwrap_or(0.0)
    };
    Spread { points: errors.len(), median: quantile(0.5), p95: quantile(0.95) }
}
