//! How long each stage of the work on a pair takes.

use serde_json::{Map, Value, json};
use vergence_pipeline::Stage;

use crate::cmd::report::rounded;
use crate::stopwatch::Stopwatch;

/// A stopwatch that is read at the end of every stage.
///
/// `vergence-pipeline` has no clock: it calls [`Self::ended`] instead.
pub struct StageTimes {
    running: Stopwatch,
    seconds: Vec<(Stage, f64)>,
}

impl StageTimes {
    /// Starts the first stage.
    pub fn start() -> Self {
        Self { running: Stopwatch::start(), seconds: Vec::new() }
    }

    /// Notes the time of `stage`, which ends now, and starts the next.
    pub fn ended(&mut self, stage: Stage) {
        self.seconds.push((stage, self.running.seconds()));
        self.running = Stopwatch::start();
    }

    /// The stages in the order in which they ran, in seconds.
    pub fn seconds(&self) -> &[(Stage, f64)] {
        &self.seconds
    }

    /// How long `stage` took, in seconds; zero where it did not run.
    pub fn of(&self, stage: Stage) -> f64 {
        self.seconds.iter().filter(|(ran, _)| *ran == stage).map(|(_, seconds)| seconds).sum()
    }

    /// `{"match": 0.61, ...}`, in seconds.
    pub fn json(&self) -> Map<String, Value> {
        self.seconds.iter().map(|&(stage, seconds)| (stage.as_str().to_owned(), json!(rounded(seconds)))).collect()
    }
}
