//! Stated probabilities beside how often they hold.

use std::fmt;

use serde_json::{Value, json};
use vergence_rig::rounded;

/// Upper ends of the bins of scores.
const ENDS: [f32; 7] = [0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0];

/// For each bin of scores: what they state, and what holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reliability {
    bins: [Bin; ENDS.len()],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bin {
    count: usize,
    stated: f64,
    held: usize,
}

impl Reliability {
    /// Adds a point with this score; `held` where its range is no outlier.
    pub fn add(&mut self, score: f32, held: bool) {
        let bin = ENDS.iter().position(|end| score <= *end).unwrap_or(ENDS.len() - 1);
        self.bins[bin].add(Bin { count: 1, stated: f64::from(score), held: usize::from(held) });
    }

    /// Adds the points of another pair.
    pub fn merge(&mut self, other: &Self) {
        self.bins.iter_mut().zip(&other.bins).for_each(|(bin, other)| bin.add(*other));
    }

    /// The bins that have points.
    fn filled(&self) -> impl Iterator<Item = (f32, f32, &Bin)> {
        let starts = [0.0].into_iter().chain(ENDS);
        starts.zip(ENDS).zip(&self.bins).map(|((from, to), bin)| (from, to, bin)).filter(|(.., bin)| bin.count > 0)
    }

    /// `[{"from", "to", "points", "stated", "held"}]`.
    #[must_use]
    pub fn json(&self) -> Value {
        let bin = |(from, to, bin): (f32, f32, &Bin)| {
            json!({
                "from": rounded(f64::from(from)), "to": rounded(f64::from(to)), "points": bin.count,
                "stated": rounded(bin.mean_stated()), "held": rounded(bin.part_held()),
            })
        };
        self.filled().map(bin).collect()
    }
}

impl Bin {
    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.stated += other.stated;
        self.held += other.held;
    }

    fn mean_stated(&self) -> f64 {
        self.stated / self.count.max(1) as f64
    }

    fn part_held(&self) -> f64 {
        self.held as f64 / self.count.max(1) as f64
    }
}

impl fmt::Display for Reliability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (from, to, bin)) in self.filled().enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(
                f,
                "{comma}{from:.2} to {to:.2}: {:.3} of {} ({:.3})",
                bin.part_held(),
                bin.count,
                bin.mean_stated()
            )?;
        }
        Ok(())
    }
}
