//! The folder of models.

use std::path::{Path, PathBuf};

use vergence_matching::learned::{Manifest, Model, Networks};

use crate::error::ModelsError;
use crate::files::{digest, make_folder, read, write_whole};
use crate::runtime::Runtime;

/// Name of the manifest in a model's folder.
pub const MODEL_FILE: &str = "model.toml";

/// The folder of kept models.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelStore {
    folder: PathBuf,
}

impl ModelStore {
    /// The store in `folder`; without one, `vergence/models` in the user's data folder. Nothing is written.
    ///
    /// # Errors
    /// Fails if no folder is named and the user has no data folder.
    pub fn open(folder: Option<PathBuf>) -> Result<Self, ModelsError> {
        let folder = folder.or_else(default_folder).ok_or(ModelsError::NoDataFolder)?;
        Ok(Self { folder })
    }

    /// The folder of the store.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of one model.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The names of all models, in order.
    ///
    /// # Errors
    /// Fails if the folder exists and cannot be read.
    pub fn names(&self) -> Result<Vec<String>, ModelsError> {
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(ModelsError::read(&self.folder, error)),
        };
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|error| ModelsError::read(&self.folder, error))?;
            if entry.path().join(MODEL_FILE).is_file() {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// Copies the model's files from the folder `source` into the store, and records their digests in its manifest. A
    /// model of the same name is replaced. Returns the model's folder.
    ///
    /// # Errors
    /// Where a name cannot name a folder or file, or a file cannot be read or written, or has another digest.
    pub fn keep(&self, mut manifest: Manifest, source: &Path) -> Result<PathBuf, ModelsError> {
        let plain = |text: &str| {
            !text.is_empty()
                && !text.starts_with('.')
                && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
        };
        let bad = std::iter::once(manifest.name.as_str())
            .chain(manifest.files().map(|(file, _)| file))
            .find(|name| !plain(name))
            .map(str::to_owned);
        if let Some(name) = bad {
            return Err(ModelsError::Name(name));
        }
        let folder = self.path(&manifest.name);
        make_folder(&folder)?;
        for (file, digest_slot) in files_mut(&mut manifest) {
            let from = source.join(&*file);
            let bytes = read(&from)?;
            let found = digest(&bytes);
            if let Some(expected) = digest_slot.as_deref().filter(|expected| *expected != found) {
                return Err(wrong_digest(&from, expected, &found));
            }
            *digest_slot = Some(found);
            write_whole(&folder.join(&*file), &bytes)?;
        }
        let text = toml::to_string(&manifest).map_err(|error| ModelsError::Record(error.to_string()))?;
        // Written last: a folder without a manifest is no model.
        write_whole(&folder.join(MODEL_FILE), text.as_bytes())?;
        Ok(folder)
    }
}

/// Reads a model's manifest from its folder.
///
/// # Errors
/// Fails if the manifest is missing or not understood.
pub fn read_manifest(folder: &Path) -> Result<Manifest, ModelsError> {
    let path = folder.join(MODEL_FILE);
    let text = std::fs::read_to_string(&path).map_err(|error| ModelsError::read(&path, error))?;
    toml::from_str(&text).map_err(|error| ModelsError::read(&path, error))
}

/// Reads a model's files and checks the digests that are on record.
fn read_files(folder: &Path, manifest: &Manifest) -> Result<Vec<(String, Vec<u8>)>, ModelsError> {
    let mut files = Vec::new();
    for (file, expected) in manifest.files() {
        let path = folder.join(file);
        let bytes = read(&path)?;
        let found = digest(&bytes);
        if let Some(expected) = expected.filter(|expected| *expected != found) {
            return Err(wrong_digest(&path, expected, &found));
        }
        files.push((file.to_owned(), bytes));
    }
    Ok(files)
}

/// Loads the model in `folder`.
///
/// # Errors
/// Where a file is missing, differs from its digest, or does not fit the manifest.
pub fn load(folder: &Path, runtime: &Runtime) -> Result<Model, ModelsError> {
    let manifest = read_manifest(folder)?;
    let files = read_files(folder, &manifest)?;
    runtime.model(manifest, &files).map_err(ModelsError::Load)
}

/// Checks that the files of the model in `folder` are there, with the digests that are on record. Returns their number.
///
/// # Errors
/// Where the manifest or a file is missing, or a file differs from its digest.
pub fn intact(folder: &Path) -> Result<usize, ModelsError> {
    let manifest = read_manifest(folder)?;
    Ok(read_files(folder, &manifest)?.len())
}

fn wrong_digest(path: &Path, expected: &str, found: &str) -> ModelsError {
    ModelsError::Digest { path: path.to_owned(), expected: expected.to_owned(), found: found.to_owned() }
}

fn files_mut(manifest: &mut Manifest) -> Vec<(&mut String, &mut Option<String>)> {
    match &mut manifest.networks {
        Networks::Separate { extractor, matcher } => {
            vec![(&mut extractor.file, &mut extractor.sha256), (&mut matcher.file, &mut matcher.sha256)]
        }
        Networks::EndToEnd(pipeline) => vec![(&mut pipeline.file, &mut pipeline.sha256)],
    }
}

/// `vergence/models` in the user's data folder, by the XDG base directory specification.
fn default_folder() -> Option<PathBuf> {
    let data = std::env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let data = data.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/share")))?;
    Some(data.join("vergence").join("models"))
}
