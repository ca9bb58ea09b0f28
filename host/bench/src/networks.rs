//! Time that networks take for a pair of images, beside Python's onnxruntime.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_matching::learned::{Manifest, Model};
use vergence_models::{ModelsError, Pattern, Runtime, load, read_manifest, threads};
use vergence_rig::rounded;
use vergence_vision::median;

use crate::error::BenchError;
use crate::python::ask_python;
use crate::{Clock, timed};

/// Side of both images, in pixels: they have some 3800 keypoints.
pub const SIDE: usize = 512;
/// Script that times Python's onnxruntime.
const ONNXRUNTIME: &str = include_str!("onnxruntime_pair.py");

/// A model on every runtime of this machine, and Python's onnxruntime on the same files.
pub struct NetworkBench<'a> {
    folder: &'a Path,
    models: Vec<(&'static str, Model)>,
    manifest: String,
    pattern: Pattern,
    scratch: tempfile::TempDir,
    python: &'a str,
    clock: Clock,
}

/// Milliseconds for a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairTime {
    /// Median of all runs; of Python, the median of the medians of its turns.
    pub median_ms: f64,
    /// Least of all runs.
    pub least_ms: f64,
}

/// Python's onnxruntime on the same pair.
#[derive(Clone, Debug, PartialEq)]
pub struct PythonTime {
    /// Milliseconds for a pair.
    pub time: PairTime,
    /// Keypoints that were matched.
    pub keypoints: usize,
    /// Version of onnxruntime.
    pub version: String,
}

/// Figures for one count of keypoints.
#[derive(Clone, Debug)]
pub struct NetworkTimes {
    /// Keypoints that were matched.
    pub keypoints: usize,
    /// Name and time of each runtime.
    pub runtimes: Vec<(&'static str, PairTime)>,
    /// Python's time, or a sentence that says why there is none.
    pub python: Result<PythonTime, String>,
}

/// Answer of the script.
#[derive(Clone, Debug, serde::Deserialize)]
struct Answer {
    median_ms: f64,
    least_ms: f64,
    keypoints: usize,
    version: String,
}

impl<'a> NetworkBench<'a> {
    /// Loads the model in `folder` on every one of `runtimes`; `python` is the interpreter that has onnxruntime.
    ///
    /// # Errors
    /// Where the model cannot be loaded, or the pattern for Python cannot be written to a temporary file.
    pub fn new(folder: &'a Path, runtimes: &[Runtime], python: &'a str, clock: Clock) -> Result<Self, BenchError> {
        let manifest: Manifest = read_manifest(folder)?;
        let models = runtimes.iter().map(|runtime| Ok((runtime.name(), load(folder, runtime)?)));
        let models = models.collect::<Result<_, ModelsError>>()?;
        let manifest = serde_json::to_string(&manifest).map_err(|error| BenchError::Work(error.to_string()))?;
        let scratch = tempfile::tempdir().map_err(BenchError::temporary)?;
        let bench = Self { folder, models, manifest, pattern: Pattern::new(SIDE), scratch, python, clock };
        let values: Vec<u8> = bench.pattern.values().iter().flat_map(|value| value.to_le_bytes()).collect();
        std::fs::write(bench.image(), values).map_err(BenchError::temporary)?;
        Ok(bench)
    }

    /// Extracts and matches up to `keypoints` keypoints of a pair: `rounds` turns of every runtime and of Python, each of
    /// `runs` runs.
    ///
    /// # Errors
    /// Where a network fails.
    pub fn times(&self, keypoints: usize, rounds: u16, runs: u16) -> Result<NetworkTimes, BenchError> {
        let mut ours = vec![Vec::new(); self.models.len()];
        let mut theirs: Result<Answer, String> = Err("it was not asked".to_owned());
        let mut medians = Vec::new();
        let mut matched = 0;
        for _ in 0..rounds {
            for ((_, model), times) in self.models.iter().zip(&mut ours) {
                let (count, taken) = self.milliseconds(model, keypoints, runs)?;
                matched = count;
                times.extend(taken);
            }
            let answer = self.ask(keypoints, runs);
            medians.extend(answer.as_ref().map(|times| times.median_ms));
            theirs = match (theirs, answer) {
                (Ok(best), Ok(now)) => Ok(if now.least_ms < best.least_ms { now } else { best }),
                (_, now) => now,
            };
        }
        let median_ms = median(medians).unwrap_or_default();
        let time = |times: Vec<f64>| {
            let least_ms = times.iter().copied().fold(f64::INFINITY, f64::min);
            PairTime { median_ms: median(times).unwrap_or_default(), least_ms }
        };
        Ok(NetworkTimes {
            keypoints: matched,
            runtimes: self.models.iter().zip(ours).map(|((name, _), times)| (*name, time(times))).collect(),
            python: theirs.map(|Answer { least_ms, keypoints, version, .. }| PythonTime {
                time: PairTime { median_ms, least_ms },
                keypoints,
                version,
            }),
        })
    }

    /// Keypoints that were matched, and the milliseconds of each run after one that warms up.
    fn milliseconds(&self, model: &Model, keypoints: usize, runs: u16) -> Result<(usize, Vec<f64>), BenchError> {
        let pair = || {
            let (found, seconds) = timed(self.clock, || self.pattern.with_itself(model, keypoints));
            let found = found.map_err(ModelsError::Run)?;
            Ok::<_, BenchError>((found.keypoints[0].len(), 1e3 * seconds))
        };
        let (matched, _) = pair()?;
        let times: Result<Vec<f64>, BenchError> = (0..runs).map(|_| Ok(pair()?.1)).collect();
        Ok((matched, times?))
    }

    fn ask(&self, keypoints: usize, runs: u16) -> Result<Answer, String> {
        let paths = [self.folder, &self.image()].map(|path| path.display().to_string());
        let numbers = [SIDE, SIDE, keypoints, threads(), usize::from(runs)].map(|number| number.to_string());
        let arguments = std::iter::once(self.manifest.clone()).chain(paths).chain(numbers);
        ask_python(self.python, ONNXRUNTIME, arguments)
    }

    /// The file with the pattern: 32-bit floating-point numbers by rows.
    fn image(&self) -> PathBuf {
        self.scratch.path().join("image.f32")
    }
}

impl NetworkTimes {
    /// Milliseconds for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let one = |name: &str, time: &PairTime| format!("{name} {:.0} ({:.0})", time.median_ms, time.least_ms);
        let mut all: Vec<String> = self.runtimes.iter().map(|(name, time)| one(name, time)).collect();
        all.extend(self.python.as_ref().map(|peer| one(&format!("Python's onnxruntime {}", peer.version), &peer.time)));
        format!("{:>6} keypoints: {}", self.keypoints, all.join(", "))
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let time =
            |time: &PairTime| json!({ "median_ms": rounded(time.median_ms), "least_ms": rounded(time.least_ms) });
        let mut row = json!({ "keypoints": self.keypoints });
        for (name, of_runtime) in &self.runtimes {
            row[*name] = time(of_runtime);
        }
        row["python"] = self.python.as_ref().map_or(Value::Null, |peer| {
            let mut value = time(&peer.time);
            value["keypoints"] = peer.keypoints.into();
            value["version"] = peer.version.as_str().into();
            value
        });
        row
    }
}
