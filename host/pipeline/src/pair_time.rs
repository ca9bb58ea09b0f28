//! What a pair takes: a time of its own, whatever its points, and a time for its points.
//!
//! Both are estimated from the pairs that were measured by a Kalman filter (Y. Bar-Shalom, X. Li and T. Kirubarajan, *Estimation with
//! Applications to Tracking and Navigation*, 2001, §5.2). A computer that becomes slower does so in both parts, and only pairs of different
//! numbers of points tell one part from the other, so that the filter keeps their ratio while the number stays.

use nalgebra::{Matrix2, Vector2};

/// Part of its own time in what the first pair takes, before others tell.
const FIXED: f64 = 0.35;
/// Standard deviation of that part.
const SPLIT: f64 = 0.3;
/// By which part of it the time of the first pair says too much or too little of the others.
const FIRST_NOISE: f64 = 0.5;
/// By which part single pairs take more or less than predicted. What departs by more than this counts as if it departed by this: one slow pair
/// says little.
const NOISE: f64 = 0.15;
/// By which part the time of all pairs changes from one to the next.
const DRIFT: f64 = 0.03;
/// A pair's own time is never known better than to this part of the whole: views are kept while the axes stand, and computed anew while they turn.
const UNSURE: f64 = 0.05;
/// Smallest part of the points in what a pair with all of them takes.
const LEAST_FOR_POINTS: f64 = 0.2;
/// So many pairs one after the other that all depart by more than this factor, to the same side, are no hiccups: the computer became slower or faster.
const JUMPED: usize = 3;
const JUMP: f64 = 1.3;

/// Estimates of both times.
#[derive(Clone, Debug)]
pub(crate) struct PairTime {
    /// Seconds of a pair's own, and of all points that there may be.
    parts: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// Logarithms of measured over predicted time of the latest pairs.
    departures: [f64; JUMPED],
}

impl PairTime {
    /// From the first pair, which took so many seconds for that part of all points.
    pub fn first(seconds: f64, part: f64) -> Self {
        let parts = Vector2::new(FIXED, (1.0 - FIXED) / part) * seconds;
        Self { parts, covariance: spread(&parts, part, FIRST_NOISE), departures: [0.0; JUMPED] }
    }

    /// Seconds that a pair takes, whatever its points.
    pub fn fixed(&self) -> f64 {
        self.parts.x
    }

    /// Seconds that a pair takes with this part of all points.
    pub fn with(&self, part: f64) -> f64 {
        self.parts.x + self.parts.y * part
    }

    /// The part of all points with which a pair takes so many seconds; negative where it takes more with none.
    pub fn part_within(&self, seconds: f64) -> f64 {
        (seconds - self.parts.x) / self.parts.y
    }

    /// Takes one more pair.
    pub fn note(&mut self, seconds: f64, part: f64) {
        self.departures.rotate_left(1);
        self.departures[JUMPED - 1] = (seconds / self.with(part)).ln();
        if let Some(jump) = self.jump() {
            self.parts *= jump;
            self.covariance = spread(&self.parts, part, NOISE);
            self.departures = [0.0; JUMPED];
        }
        self.update(seconds, part);
        self.keep_within(part);
    }

    /// The factor by which the computer became slower, or faster where it is less than one.
    fn jump(&self) -> Option<f64> {
        let least = self.departures.into_iter().fold(f64::INFINITY, |least, it| least.min(it.abs()));
        let (slower, faster) = (|it: &f64| *it > JUMP.ln(), |it: &f64| *it < -JUMP.ln());
        let by = if self.departures.iter().all(slower) { least } else { -least };
        (by > 0.0 || self.departures.iter().all(faster)).then_some(by.exp())
    }

    fn update(&mut self, seconds: f64, part: f64) {
        let (of, predicted) = (Vector2::new(1.0, part), self.with(part));
        self.covariance += self.parts * self.parts.transpose() * (DRIFT * DRIFT);
        self.covariance.m11 = self.covariance.m11.max((UNSURE * predicted).powi(2));
        let variance = (of.transpose() * self.covariance * of).x + (NOISE * predicted).powi(2);
        let gain = self.covariance * of / variance;
        let most = variance.sqrt();
        self.parts += gain * (seconds - predicted).clamp(-most, most);
        self.covariance -= gain * (gain * variance).transpose();
    }

    /// Keeps both parts in their bounds, and what is predicted for `part` of the points as it is.
    fn keep_within(&mut self, part: f64) {
        const MOST: f64 = (1.0 - LEAST_FOR_POINTS) / LEAST_FOR_POINTS;
        let predicted = self.with(part);
        if self.parts.x < 0.0 {
            self.parts = Vector2::new(0.0, predicted / part);
        } else if self.parts.x > MOST * self.parts.y {
            let all = predicted / (MOST + part);
            self.parts = Vector2::new(MOST * all, all);
        }
    }
}

/// The covariance of times that are known to the part `noise` together, and to [`SPLIT`] of the whole one from the other, where they were measured with
/// this part of all points.
fn spread(parts: &Vector2<f64>, part: f64, noise: f64) -> Matrix2<f64> {
    let split = Vector2::new(1.0, -part.recip()) * (SPLIT * (parts.x + parts.y * part));
    parts * parts.transpose() * (noise * noise) + split * split.transpose()
}
