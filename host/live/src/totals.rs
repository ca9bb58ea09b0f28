//! Counts of what became of the exposures of a run.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use vergence_pipeline::{Observation, SkipReason};

/// Counts of results and of what was skipped.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Number of clouds.
    pub clouds: u64,
    /// Number of sets of bearings.
    pub bearings: u64,
    /// Number of exposures that were skipped, by reason.
    pub skipped: BTreeMap<SkipReason, u64>,
    /// Number of trigger pulses that the board told of. Each is a result, skipped for a [reason of pulses](SkipReason::is_of_pulse), or open.
    pub pulses: u64,
    /// Number of pulses, or of exposures of cameras that run freely, of which nothing is decided yet.
    pub open: u64,
}

impl Totals {
    /// Counts one more result.
    pub fn count(&mut self, observation: &Observation) {
        match observation {
            Observation::Points { .. } => self.clouds += 1,
            Observation::Bearings { .. } => self.bearings += 1,
        }
    }

    /// All counts for programs, as the last line of a run.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "kind": "end",
            "clouds": self.clouds,
            "bearings": self.bearings,
            "skipped": self.skipped_json(),
            "pulses": self.pulses,
            "open": self.open,
        })
    }

    /// What was skipped by reason, for programs.
    #[must_use]
    pub fn skipped_json(&self) -> Value {
        self.skipped.iter().map(|(reason, count)| (reason.as_str().to_owned(), json!(count))).collect()
    }

    /// What was skipped, for people; nothing where nothing was.
    #[must_use]
    pub fn skipped_in_words(&self) -> String {
        let reason = |(reason, count): (&SkipReason, &u64)| format!("{} {count}", reason.as_str());
        let reasons: Vec<_> = self.skipped.iter().map(reason).collect();
        if reasons.is_empty() { String::new() } else { format!("; skipped: {}", reasons.join(", ")) }
    }
}
