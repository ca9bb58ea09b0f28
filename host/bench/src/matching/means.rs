//! Mean figures of a way of matching over several seeds.

use std::fmt;

use serde_json::{Value, json};
use vergence_rig::rounded;

use crate::matching::judge::Class;
use crate::matching::reliability::Reliability;
use crate::matching::ways::Outcome;

/// Counts before and after the gates, and times.
#[derive(Clone, Debug, Default)]
pub struct Means {
    before: Counts,
    after: Counts,
    registered: Class,
    unregistered: Class,
    reliability: Reliability,
    seconds: f64,
    network_seconds: f64,
}

#[derive(Clone, Debug, Default)]
struct Counts {
    matches: usize,
    correct: Vec<usize>,
}

impl Means {
    /// Adds the result of one more seed.
    pub fn add(&mut self, outcome: &Outcome) {
        for (counts, tally) in [(&mut self.before, &outcome.before), (&mut self.after, &outcome.after)] {
            counts.matches += tally.count;
            counts.correct.push(tally.correct);
        }
        self.registered.merge(&outcome.after.registered);
        self.unregistered.merge(&outcome.after.unregistered);
        self.reliability.merge(&outcome.after.reliability);
        self.seconds += outcome.seconds;
        self.network_seconds += outcome.network_seconds;
    }

    /// Stated and real uncertainty of all points, for people; empty without points.
    #[must_use]
    pub fn honesty(&self) -> Vec<String> {
        let classes = [("registered", &self.registered), ("unregistered", &self.unregistered)];
        let filled = classes.into_iter().filter(|(_, class)| class.count() > 0);
        let lines: Vec<String> = filled.map(|(name, class)| format!("{name} {class}")).collect();
        let scores = (!lines.is_empty()).then(|| format!("score, found (stated): {}", self.reliability));
        lines.into_iter().chain(scores).collect()
    }

    /// The figures as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let mean = |sum: f64| rounded(sum / self.before.correct.len().max(1) as f64);
        json!({
            "before": self.before.json(),
            "after": self.after.json(),
            "registered": self.registered.json(),
            "unregistered": self.unregistered.json(),
            "reliability": self.reliability.json(),
            "seconds": mean(self.seconds),
            "network_seconds": mean(self.network_seconds),
        })
    }
}

impl Counts {
    fn mean(&self) -> f64 {
        self.correct.iter().sum::<usize>() as f64 / self.correct.len().max(1) as f64
    }

    /// Part of all matches of all seeds that is right.
    fn precision(&self) -> f64 {
        self.correct.iter().sum::<usize>() as f64 / self.matches.max(1) as f64
    }

    fn range(&self) -> [usize; 2] {
        [self.correct.iter().min(), self.correct.iter().max()].map(|count| count.copied().unwrap_or_default())
    }

    fn json(&self) -> Value {
        let [least, most] = self.range();
        json!({ "correct": rounded(self.mean()), "least": least, "most": most, "precision": rounded(self.precision()) })
    }
}

impl fmt::Display for Means {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.network_seconds / self.seconds;
        write!(f, "{} -> {}, {share:.0} % of the time in networks", self.before, self.after)
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.range();
        write!(f, "{:.0} ({least} to {most}; {:.2})", self.mean(), self.precision())
    }
}
