//! Chooses a kept model by its name, and the runtime that is fastest with it.

use vergence_matching::learned::Model;

use crate::error::ModelsError;
use crate::runtime::Runtimes;
use crate::store::{ModelStore, load};

/// The model wanted for matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelName<'a> {
    /// The model that is kept under this name.
    Named(&'a str),
    /// The only model that is kept.
    Only,
}

/// A loaded model.
pub struct Chosen {
    /// Name of the model in the store.
    pub name: String,
    /// The networks.
    pub model: Model,
    /// The runtime's name.
    pub runtime: &'static str,
    /// Why this runtime was chosen, as a few words for people.
    pub because: String,
}

/// Loads the model that is wanted.
///
/// # Errors
/// Where no such model is kept, where [`ModelName::Only`] is wanted and several are kept, or where it cannot be loaded.
pub fn choose(store: &ModelStore, wanted: ModelName<'_>, runtimes: &Runtimes) -> Result<Chosen, ModelsError> {
    let names = store.names()?;
    let folder = || store.folder().to_owned();
    let name = match (wanted, names.as_slice()) {
        (ModelName::Only, [only]) => only.clone(),
        (ModelName::Only, []) => return Err(ModelsError::NoneKept { folder: folder() }),
        (ModelName::Only, several) => return Err(ModelsError::SeveralKept(several.to_vec())),
        (ModelName::Named(name), names) if names.iter().any(|kept| kept == name) => name.to_owned(),
        (ModelName::Named(name), _) => return Err(ModelsError::NotKept { name: name.to_owned(), folder: folder() }),
    };
    let (runtime, because) = runtimes.choose(&store.path(&name))?;
    let model = load(&store.path(&name), &runtime)?;
    Ok(Chosen { name, model, runtime: runtime.name(), because })
}
