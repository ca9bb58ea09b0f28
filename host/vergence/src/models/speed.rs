//! How fast each runtime is with a model on this machine: measured once, kept beside the model.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vergence_matching::learned::Model;

use super::pattern::{Pattern, SMALL_KEYPOINTS};
use super::runtime::Runtime;
use super::store::load;
use crate::failure::Failure;
use crate::output::write_whole;
use crate::stopwatch::Stopwatch;

/// The record, in the model's folder.
const SPEED_FILE: &str = "speed.toml";
/// The least of so many runs, the first of which warms up.
const RUNS: usize = 3;

/// Seconds for one drawn pattern matched with itself, by each runtime.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed {
    /// Threads used.
    pub threads: usize,
    /// By rten; absent where it cannot run the model.
    pub rten_seconds: Option<f64>,
    /// By ONNX Runtime; absent where there was none or it cannot run the model.
    pub onnxruntime_seconds: Option<f64>,
    /// The library that was.
    pub onnxruntime: Option<PathBuf>,
}

impl Speed {
    /// Times the model in `folder` on every runtime, and keeps the record there.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn measure(folder: &Path, runtimes: &[Runtime], threads: usize) -> Result<Self, Failure> {
        let mut speed = Self { threads, ..Self::default() };
        for runtime in runtimes {
            // A runtime that cannot run a model is no choice for it; `models verify` says why.
            let seconds = load(folder, runtime).ok().and_then(|model| seconds(&model));
            match runtime {
                Runtime::Rten => speed.rten_seconds = seconds,
                Runtime::OnnxRuntime(_, library) => {
                    speed.onnxruntime_seconds = seconds;
                    speed.onnxruntime = Some(library.clone());
                }
            }
        }
        let text = toml::to_string(&speed).map_err(|error| Failure::check(error.to_string()))?;
        write_whole(&folder.join(SPEED_FILE), text.as_bytes())?;
        Ok(speed)
    }

    /// Seconds by one of them.
    #[must_use]
    pub fn of(&self, runtime: &Runtime) -> Option<f64> {
        match runtime {
            Runtime::Rten => self.rten_seconds,
            Runtime::OnnxRuntime(..) => self.onnxruntime_seconds,
        }
    }

    /// The record in `folder`; `None` where there is none that is understood.
    #[must_use]
    pub fn read(folder: &Path) -> Option<Self> {
        toml::from_str(&std::fs::read_to_string(folder.join(SPEED_FILE)).ok()?).ok()
    }
}

fn seconds(model: &Model) -> Option<f64> {
    let pattern = Pattern::small();
    let run = |_| {
        let watch = Stopwatch::start();
        pattern.with_itself(model, SMALL_KEYPOINTS).ok()?;
        Some(watch.seconds())
    };
    let runs: Option<Vec<f64>> = (0..RUNS).map(run).collect();
    runs?.into_iter().reduce(f64::min)
}
