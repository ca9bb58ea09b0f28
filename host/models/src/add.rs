//! Keeps files that the user has.

use std::path::{Path, PathBuf};

use vergence_matching::learned::Manifest;

use crate::Clock;
use crate::error::ModelsError;
use crate::files::read;
use crate::known::manifest_for;
use crate::runtime::{Runtime, threads};
use crate::speed::Speed;
use crate::store::{MODEL_FILE, ModelStore, read_manifest};

/// A model that was added to the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Added {
    /// Name of the model in the store.
    pub name: String,
    /// Folder of the model in the store.
    pub folder: PathBuf,
}

/// Checks that the networks at `source` have the tensors they should, keeps copies of them, and times them on every
/// runtime. `source` is a folder with `model.toml` and the files it names, a folder with ONNX files of a known model, or
/// one ONNX file. `name` replaces the name in the manifest.
///
/// # Errors
/// Fails if a file cannot be read or written, or the networks fit no manifest.
pub fn add(
    store: &ModelStore,
    source: &Path,
    name: Option<&str>,
    runtimes: &[Runtime],
    clock: Clock,
) -> Result<Added, ModelsError> {
    let (folder, mut manifest) = manifest_at(source, runtimes)?;
    if let Some(name) = name {
        name.clone_into(&mut manifest.name);
    }
    let files = read_all(&folder, manifest.files().map(|(file, _)| file))?;
    Runtime::check(runtimes, &manifest, &files).map_err(ModelsError::Load)?;
    let name = manifest.name.clone();
    let folder = store.keep(manifest, &folder)?;
    Speed::measure(&folder, runtimes, threads(), clock)?;
    Ok(Added { name, folder })
}

/// The folder of the files, and their manifest.
fn manifest_at(source: &Path, runtimes: &[Runtime]) -> Result<(PathBuf, Manifest), ModelsError> {
    let no_manifest = |reason| ModelsError::NoManifest { path: source.to_owned(), reason };
    if source.is_file() {
        let folder = source.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = source.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let files = read_all(folder, [file.as_str()].into_iter())?;
        return Ok((folder.to_owned(), manifest_for(&files, runtimes).map_err(no_manifest)?));
    }
    if source.join(MODEL_FILE).is_file() {
        return Ok((source.to_owned(), read_manifest(source)?));
    }
    let entries = std::fs::read_dir(source).map_err(|error| ModelsError::read(source, error))?;
    let mut names: Vec<String> =
        entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| Path::new(name).extension().is_some_and(|extension| extension == "onnx"));
    names.sort();
    let files = read_all(source, names.iter().map(String::as_str))?;
    Ok((source.to_owned(), manifest_for(&files, runtimes).map_err(no_manifest)?))
}

fn read_all<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> Result<Vec<(String, Vec<u8>)>, ModelsError> {
    names.map(|name| Ok((name.to_owned(), read(&folder.join(name))?))).collect()
}
