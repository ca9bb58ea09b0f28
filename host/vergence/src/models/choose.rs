//! Which matcher serves: options shared by the verbs that match.

use vergence_matching::learned::LearnedMatcher;
use vergence_matching::{GuidedMatcher, Matcher};

use super::runtime::RuntimeOptions;
use super::store::{ModelStore, StoreOptions, load};
use crate::console::Console;
use crate::failure::Failure;

/// The name of the matcher that needs no model.
const GUIDED: &str = "guided";
/// The name of whatever model there is.
const LEARNED: &str = "learned";

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
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

impl MatcherOptions {
    /// The matcher they name; says on the console which one serves where the choice is not the user's.
    ///
    /// # Errors
    /// Where there is no such model, or it cannot be loaded.
    pub fn matcher(&self, console: Console) -> Result<Box<dyn Matcher>, Failure> {
        Ok(match self.matcher.as_deref() {
            None | Some(GUIDED) => Box::new(self.guided()),
            Some(name) => match self.model(name, console)? {
                Some(learned) => Box::new(learned),
                None => Box::new(self.guided()),
            },
        })
    }

    /// The classical matcher.
    #[must_use]
    pub fn guided(&self) -> GuidedMatcher {
        let keypoints = self.keypoints.map_or(GuidedMatcher::default().keypoints, |count| count as usize);
        GuidedMatcher { keypoints, ..GuidedMatcher::default() }
    }

    /// The learned matcher: the one they name, or the only one there is. `None` where no models are kept, or the classical
    /// one is named.
    ///
    /// # Errors
    /// As [`Self::matcher`].
    pub fn learned(&self, console: Console) -> Result<Option<LearnedMatcher>, Failure> {
        match self.matcher.as_deref() {
            Some(GUIDED) => Ok(None),
            name => self.model(name.unwrap_or(LEARNED), console),
        }
    }

    /// A model by its name. `None` where any would do and there is none, which the console is told.
    fn model(&self, name: &str, console: Console) -> Result<Option<LearnedMatcher>, Failure> {
        let store = ModelStore::open(&self.store)?;
        let names = store.names()?;
        let name = match (name, names.as_slice()) {
            (LEARNED, [only]) => only.as_str(),
            (LEARNED, []) => {
                console.warn("no models are installed (see 'vergence models'): the classical matcher serves");
                return Ok(None);
            }
            (LEARNED, several) => {
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
        let (runtime, why) = self.runtime.choose(&store.path(name))?;
        let model = load(&store.path(name), &runtime)?;
        console.say(format!("matching with {name} on {} ({why})", runtime.name()))?;
        let mut learned = LearnedMatcher::new(model);
        if let Some(keypoints) = self.keypoints {
            learned.keypoints = keypoints as usize;
        }
        Ok(Some(learned))
    }
}
