//! Options that choose a matcher, a model and a runtime; the verbs that match share them.

use std::path::PathBuf;

use vergence_matching::learned::LearnedMatcher;
use vergence_matching::{GuidedMatcher, Matcher, TrackingMatcher};
use vergence_models::{ModelName, ModelStore, ModelsError, Processor, Runtime, RuntimeKind, Runtimes, choose};

use crate::console::Console;
use crate::failure::Failure;

/// Where models are kept.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct StoreOptions {
    /// The folder that models are kept in. Without it, vergence/models in the user's data folder.
    #[arg(long, env = "VERGENCE_MODELS", value_name = "DIR")]
    models: Option<PathBuf>,
}

impl StoreOptions {
    /// The store that the options name; nothing is written.
    ///
    /// # Errors
    /// Where no folder is named and the user has no data folder.
    pub fn store(&self) -> Result<ModelStore, Failure> {
        Ok(ModelStore::open(self.models.clone())?)
    }
}

/// The program that runs the networks.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct RuntimeOptions {
    /// What runs the networks: `rten` or `onnxruntime`, both on the machine's own processor, or ONNX Runtime on a graphics
    /// processor: `cuda` or `webgpu`. Without it the one that was faster when the model was added or last verified, see
    /// `vergence models verify`.
    #[arg(long, value_name = "NAME")]
    runtime: Option<RuntimeName>,
    /// The ONNX Runtime library, such as libonnxruntime.so. Without it one that pip installed.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE")]
    onnxruntime: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum RuntimeName {
    Rten,
    #[value(name = "onnxruntime")]
    OnnxRuntime,
    Cuda,
    #[value(name = "webgpu")]
    WebGpu,
}

impl RuntimeOptions {
    /// Every runtime on this machine.
    ///
    /// # Errors
    /// Where the library that was named cannot be loaded.
    pub fn all(&self) -> Result<Vec<Runtime>, Failure> {
        Ok(self.runtimes().all()?)
    }

    fn runtimes(&self) -> Runtimes {
        let wanted = self.runtime.map(|name| match name {
            RuntimeName::Rten => RuntimeKind::Rten,
            RuntimeName::OnnxRuntime => RuntimeKind::OnnxRuntime(Processor::Cpu),
            RuntimeName::Cuda => RuntimeKind::OnnxRuntime(Processor::Cuda),
            RuntimeName::WebGpu => RuntimeKind::OnnxRuntime(Processor::WebGpu),
        });
        Runtimes { wanted, library: self.onnxruntime.clone() }
    }
}

/// The name of the matcher that needs no model.
const GUIDED: &str = "guided";
/// The name of the only model that is kept.
const LEARNED: &str = "learned";

/// How matching points are found in both images.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MatcherOptions {
    /// `guided` (classical), the name of a model (see `vergence models list`), or `learned` for the only one that is kept.
    /// Without it the classical matcher serves; `run` then follows its points from pair to pair.
    #[arg(long, value_name = "NAME")]
    matcher: Option<String>,
    /// Most keypoints per view.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(16..=4096))]
    keypoints: Option<u32>,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

impl MatcherOptions {
    /// The matcher that the options name; says on the console which model runs on which runtime.
    ///
    /// # Errors
    /// Where the model is not kept or cannot be loaded.
    pub fn matcher(&self, console: Console) -> Result<Box<dyn Matcher>, Failure> {
        Ok(match self.matcher.as_deref() {
            None | Some(GUIDED) => Box::new(self.guided()),
            Some(name) => Box::new(self.model(&self.store.store()?, name, console)?),
        })
    }

    /// The matcher for pairs that follow one another: the one that the options name, or one that follows points from pair to pair.
    ///
    /// # Errors
    /// As [`Self::matcher`].
    pub fn live(&self, console: Console) -> Result<Box<dyn Matcher>, Failure> {
        Ok(match (&self.matcher, self.keypoints) {
            (Some(_), _) => self.matcher(console)?,
            (None, Some(keypoints)) => Box::new(TrackingMatcher::with_keypoints(keypoints as usize)),
            (None, None) => Box::new(TrackingMatcher::default()),
        })
    }

    /// The classical matcher.
    #[must_use]
    pub fn guided(&self) -> GuidedMatcher {
        let keypoints = self.keypoints.map_or(GuidedMatcher::default().keypoints, |count| count as usize);
        GuidedMatcher { keypoints, ..GuidedMatcher::default() }
    }

    /// The learned matcher: the one that the options name, or the only one that is kept. `None` where the options name the
    /// classical one, or name none and no model is kept.
    ///
    /// # Errors
    /// As [`Self::matcher`].
    pub fn learned(&self, console: Console) -> Result<Option<LearnedMatcher>, Failure> {
        let store = match self.matcher.as_deref() {
            Some(GUIDED) => return Ok(None),
            _ => self.store.store()?,
        };
        match self.matcher.as_deref() {
            None if store.names()?.is_empty() => Ok(None),
            name => self.model(&store, name.unwrap_or(LEARNED), console).map(Some),
        }
    }

    fn model(&self, store: &ModelStore, name: &str, console: Console) -> Result<LearnedMatcher, Failure> {
        let name = if name == LEARNED { ModelName::Only } else { ModelName::Named(name) };
        let chosen = choose(store, name, &self.runtime.runtimes()).map_err(|error| match error {
            ModelsError::SeveralKept(names) => {
                Failure::usage(format!("say which model: --matcher {}", names.join(" or ")))
            }
            other => other.into(),
        })?;
        console.say(format!("matching with {} on {} ({})", chosen.name, chosen.runtime, chosen.because))?;
        let mut learned = LearnedMatcher::new(chosen.model);
        if let Some(keypoints) = self.keypoints {
            learned.keypoints = keypoints as usize;
        }
        Ok(learned)
    }
}
