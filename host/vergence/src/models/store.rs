//! The folder of models.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use vergence_matching::learned::{Manifest, Model, Networks};

use super::runtime::Runtime;
use crate::failure::Failure;
use crate::output::{make_folder, write_whole};

/// The manifest of a model, in its folder.
pub const MODEL_FILE: &str = "model.toml";

/// Where models are kept.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct StoreOptions {
    /// The folder that models are kept in. Without it, vergence/models in the user's data folder.
    #[arg(long, env = "VERGENCE_MODELS", value_name = "DIR")]
    pub models: Option<PathBuf>,
}

/// The kept models.
pub struct ModelStore {
    folder: PathBuf,
}

impl ModelStore {
    /// The store that the options name; nothing is written.
    ///
    /// # Errors
    /// Where no folder is named and the user has no data folder.
    pub fn open(options: &StoreOptions) -> Result<Self, Failure> {
        let folder = options.models.clone().or_else(default_folder).ok_or_else(|| {
            Failure::usage("there is no data folder for models: name one with --models, or set VERGENCE_MODELS")
        })?;
        Ok(Self { folder })
    }

    /// Where the models are.
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
    /// Where the folder is there and cannot be read.
    pub fn names(&self) -> Result<Vec<String>, Failure> {
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(Failure::input(&self.folder, error)),
        };
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|error| Failure::input(&self.folder, error))?;
            if entry.path().join(MODEL_FILE).is_file() {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// Keeps a model: its files from `source`, their digests in its manifest. What had the name before is replaced.
    ///
    /// # Errors
    /// Where the name is no name for a folder, or a file cannot be read or written.
    pub fn keep(&self, mut manifest: Manifest, source: &Path) -> Result<PathBuf, Failure> {
        let plain = |text: &str| {
            !text.is_empty()
                && !text.starts_with('.')
                && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
        };
        if !plain(&manifest.name) || !manifest.files().all(|(file, _)| plain(file)) {
            return Err(Failure::usage("names of models and their files are letters, digits, '-', '_' and '.'"));
        }
        let folder = self.path(&manifest.name);
        make_folder(&folder)?;
        for (file, digest_slot) in files_mut(&mut manifest) {
            let from = source.join(&*file);
            let bytes = std::fs::read(&from).map_err(|error| Failure::input(&from, error))?;
            let found = digest(&bytes);
            if let Some(expected) = digest_slot.as_deref().filter(|expected| *expected != found) {
                return Err(wrong_digest(&from, expected, &found));
            }
            *digest_slot = Some(found);
            write_whole(&folder.join(&*file), &bytes)?;
        }
        let text = toml::to_string(&manifest).map_err(|error| Failure::check(error.to_string()))?;
        // Last: a model without its manifest does not exist.
        write_whole(&folder.join(MODEL_FILE), text.as_bytes())?;
        Ok(folder)
    }
}

/// Reads a model's manifest from its folder.
///
/// # Errors
/// Where there is none, or it is not understood.
pub fn read_manifest(folder: &Path) -> Result<Manifest, Failure> {
    let path = folder.join(MODEL_FILE);
    let text = std::fs::read_to_string(&path).map_err(|error| Failure::input(&path, error))?;
    toml::from_str(&text).map_err(|error| Failure::input(&path, error))
}

/// Reads a model's files, checking the digests that are known.
///
/// # Errors
/// Where one cannot be read, or is another than was kept.
fn read_files(folder: &Path, manifest: &Manifest) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let mut files = Vec::new();
    for (file, expected) in manifest.files() {
        let path = folder.join(file);
        let bytes = std::fs::read(&path).map_err(|error| Failure::input(&path, error))?;
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
/// Where a file is missing, another than was kept, or does not fit the manifest.
pub fn load(folder: &Path, runtime: &Runtime) -> Result<Model, Failure> {
    let manifest = read_manifest(folder)?;
    let files = read_files(folder, &manifest)?;
    runtime.model(manifest, &files).map_err(|error| Failure::usage(error.to_string()))
}

/// SHA-256 in hexadecimal.
#[must_use]
pub fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn wrong_digest(path: &Path, expected: &str, found: &str) -> Failure {
    Failure::check(format!("{} is not the file it should be: its SHA-256 is {found}, not {expected}", path.display()))
}

fn files_mut(manifest: &mut Manifest) -> Vec<(&mut String, &mut Option<String>)> {
    match &mut manifest.networks {
        Networks::Separate { extractor, matcher } => {
            vec![(&mut extractor.file, &mut extractor.sha256), (&mut matcher.file, &mut matcher.sha256)]
        }
        Networks::EndToEnd(pipeline) => vec![(&mut pipeline.file, &mut pipeline.sha256)],
    }
}

/// By the XDG base directory specification.
fn default_folder() -> Option<PathBuf> {
    let data = std::env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let data = data.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/share")))?;
    Some(data.join("vergence").join("models"))
}
