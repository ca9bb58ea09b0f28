//! Which matcher serves: options shared by the verbs that match.

use std::path::PathBuf;

use vergence_matching::learned::LearnedMatcher;
use vergence_matching::{GuidedMatcher, Matcher};

use super::runtime::Runtime;
use super::store::{ModelStore, StoreOptions, load};
use crate::console::Console;
use crate::failure::Failure;

/// The name of the matcher that needs no model.
const GUIDED: &str = "guided";

/// How homologous points are found.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MatcherOptions {
    /// `guided` (classical), the name of a model (see `vergence models list`), or `learned` for the only one there is.
    /// Without it the classical matcher serves.
    #[arg(long, value_name = "NAME")]
    matcher: Option<String>,
    /// Most keypoints per view.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(16..=4096))]
    keypoints: Option<u32>,
    /// The ONNX Runtime library, such as libonnxruntime.so. Without it one that pip installed serves, or else rten.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE")]
    onnxruntime: Option<PathBuf>,
    #[command(flatten)]
    store: StoreOptions,
}

impl MatcherOptions {
    /// The matcher they name; says on the console which one serves where the choice is not the user's.
    ///
    /// # Errors
    /// Where there is no such model, or it cannot be loaded.
    pub fn matcher(&self, console: Console) -> Result<Box<dyn Matcher>, Failure> {
        let mut guided = GuidedMatcher::default();
        if let Some(keypoints) = self.keypoints {
            guided.keypoints = keypoints as usize;
        }
        let name = match self.matcher.as_deref() {
            None | Some(GUIDED) => return Ok(Box::new(guided)),
            Some(name) => name,
        };
        let store = ModelStore::open(&self.store)?;
        let names = store.names()?;
        let name = match (name, names.as_slice()) {
            ("learned", [only]) => only.as_str(),
            ("learned", []) => {
                console.say("no models are installed (see 'vergence models'): the classical matcher serves")?;
                return Ok(Box::new(guided));
            }
            ("learned", several) => {
                return Err(Failure::usage(format!("say which model: --matcher {}", several.join(" or "))));
            }
            (name, names) if names.iter().any(|known| known == name) => name,
            (name, _) => {
                return Err(Failure::usage(format!(
                    "there is no model '{name}' in {}: see 'vergence models list'",
                    store.folder().display()
                )));
            }
        };
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let runtime =
            Runtime::find(self.onnxruntime.clone(), threads).map_err(|error| Failure::usage(error.to_string()))?;
        let model = load(&store.path(name), &runtime)?;
        console.say(format!("matching with {name} on {}", runtime.name()))?;
        let mut learned = LearnedMatcher::new(model);
        if let Some(keypoints) = self.keypoints {
            learned.keypoints = keypoints as usize;
        }
        Ok(Box::new(learned))
    }
}
