//! How fast each runtime is with a model on this machine: measured once and kept beside the model.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vergence_matching::learned::Model;
use vergence_networks::Processor;

use crate::Clock;
use crate::error::ModelsError;
use crate::files::write_whole;
use crate::pattern::{Pattern, SMALL_KEYPOINTS};
use crate::runtime::Runtime;
use crate::store::load;

/// Name of the record in the model's folder.
const SPEED_FILE: &str = "speed.toml";
/// Runs whose least time counts; the first one warms up.
const RUNS: usize = 3;

/// Seconds for one drawn pattern matched with itself, by each runtime.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed {
    /// Threads that ran the networks.
    pub threads: usize,
    /// Seconds by rten; absent where it cannot run the model.
    pub rten_seconds: Option<f64>,
    /// Seconds by ONNX Runtime; absent where it was missing or cannot run the model.
    pub onnxruntime_seconds: Option<f64>,
    /// The ONNX Runtime library that was timed.
    pub onnxruntime: Option<PathBuf>,
    /// What computed for ONNX Runtime.
    #[serde(default)]
    pub processor: Processor,
}

impl Speed {
    /// Times the model in `folder` on every runtime, and writes the record there.
    ///
    /// # Errors
    /// Fails if the record cannot be written.
    pub fn measure(folder: &Path, runtimes: &[Runtime], threads: usize, clock: Clock) -> Result<Self, ModelsError> {
        let mut speed = Self { threads, ..Self::default() };
        for runtime in runtimes {
            // A runtime that cannot run a model is no choice for it; `models verify` says why.
            let seconds = load(folder, runtime).ok().and_then(|model| seconds(&model, clock));
            match runtime {
                Runtime::Rten => speed.rten_seconds = seconds,
                Runtime::OnnxRuntime(onnx, library) => {
                    speed.processor = onnx.processor();
                    speed.onnxruntime_seconds = seconds;
                    speed.onnxruntime = Some(library.clone());
                }
            }
        }
        let text = toml::to_string(&speed).map_err(|error| ModelsError::Record(error.to_string()))?;
        write_whole(&folder.join(SPEED_FILE), text.as_bytes())?;
        Ok(speed)
    }

    /// Seconds by `runtime`; `None` where it has not been timed.
    #[must_use]
    pub fn of(&self, runtime: &Runtime) -> Option<f64> {
        match runtime {
            Runtime::Rten => self.rten_seconds,
            Runtime::OnnxRuntime(..) => self.onnxruntime_seconds,
        }
    }

    /// The record in `folder`; `None` where it is missing or not understood.
    #[must_use]
    pub fn read(folder: &Path) -> Option<Self> {
        toml::from_str(&std::fs::read_to_string(folder.join(SPEED_FILE)).ok()?).ok()
    }
}

fn seconds(model: &Model, clock: Clock) -> Option<f64> {
    let pattern = Pattern::small();
    let run = |_| {
        let start = clock();
        pattern.with_itself(model, SMALL_KEYPOINTS).ok()?;
        Some(clock().saturating_sub(start).as_secs_f64())
    };
    let runs: Option<Vec<f64>> = (0..RUNS).map(run).collect();
    runs?.into_iter().reduce(f64::min)
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails loudly")]
mod tests {
    use super::*;

    #[test]
    fn a_record_without_a_processor_is_of_the_machines_own() {
        let record: Speed = toml::from_str("threads = 2\nonnxruntime_seconds = 0.5\n").expect("an older record");
        assert_eq!(record.processor, Processor::Cpu);
        let text = toml::to_string(&Speed { processor: Processor::Cuda, ..record }).expect("a record");
        assert_eq!(toml::from_str::<Speed>(&text).expect("as written").processor, Processor::Cuda);
    }
}
