//! What can go wrong with models.

use std::path::{Path, PathBuf};

use vergence_matching::learned::NetworkError;

/// Why a model cannot be kept, fetched, loaded or run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelsError {
    /// The user has no data folder and named none.
    #[error("there is no data folder for models: name one with --models, or set VERGENCE_MODELS")]
    NoDataFolder,
    /// A file or folder cannot be read, or its text is not understood.
    #[error("{}: {reason}", .path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The message of the system or the parser.
        reason: String,
    },
    /// A file or folder cannot be written.
    #[error("cannot write {}: {reason}", .path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The message of the system.
        reason: String,
    },
    /// The name of a model or of one of its files cannot name a folder or file of the store.
    #[error("'{0}' cannot name a model or its file: use letters, digits, '-', '_' and '.'")]
    Name(String),
    /// A file differs from the one that was recorded.
    #[error("{} is not the file it should be: its SHA-256 is {found}, not {expected}", .path.display())]
    Digest {
        /// The file.
        path: PathBuf,
        /// SHA-256 on record, in hexadecimal.
        expected: String,
        /// SHA-256 of the file, in hexadecimal.
        found: String,
    },
    /// A downloaded file differs from the one that was recorded or asked for.
    #[error("the download has SHA-256 {found}, not {expected}: it was deleted, and nothing was changed")]
    DownloadDigest {
        /// SHA-256 on record or asked for, in hexadecimal.
        expected: String,
        /// SHA-256 of the download, in hexadecimal.
        found: String,
    },
    /// A downloaded file is not the network it should be.
    #[error("{reason}; the download is in {}", .path.display())]
    DownloadNetwork {
        /// The error of the network.
        reason: NetworkError,
        /// Path of the file.
        path: PathBuf,
    },
    /// The download failed.
    #[error("{address} could not be fetched ({reason}){}", kept_note(*.partial))]
    Fetch {
        /// The address.
        address: String,
        /// The message of curl.
        reason: String,
        /// Whether a part of the file came and is kept.
        partial: bool,
    },
    /// The program that downloads is missing.
    #[error("curl does not start ({reason}): install it, or fetch {address} yourself and add it")]
    Curl {
        /// The message of the system.
        reason: String,
        /// The address that was asked for.
        address: String,
    },
    /// No known publisher offers a model of this name.
    #[error("nobody is known to offer '{0}': see 'vergence models list'")]
    Unknown(String),
    /// The publisher offers no file that could be downloaded and used.
    #[error("{name}: {about}")]
    NotOffered {
        /// The model.
        name: &'static str,
        /// The missing thing and how to get it.
        about: &'static str,
    },
    /// The licence forbids commercial use, and the user has not accepted it.
    #[error("{name} is licensed '{licence}': read the licence, and pass --accept-non-commercial if you keep to it")]
    NonCommercial {
        /// The model.
        name: &'static str,
        /// Licence of the model.
        licence: &'static str,
    },
    /// The networks in these files fit no known model, or several.
    #[error("{}: {reason}", .path.display())]
    NoManifest {
        /// The file or folder.
        path: PathBuf,
        /// Why no manifest could be chosen.
        reason: String,
    },
    /// The model that was asked for is not kept.
    #[error("there is no model '{name}' in {}: see 'vergence models list'", .folder.display())]
    NotKept {
        /// The model.
        name: String,
        /// The store.
        folder: PathBuf,
    },
    /// Any model would do, and none is kept.
    #[error("no model is kept in {}: see 'vergence models', or leave out --matcher for the classical matcher", .folder.display())]
    NoneKept {
        /// The store.
        folder: PathBuf,
    },
    /// Any model would do, and several are kept.
    #[error("several models are kept: choose one of {}", .0.join(", "))]
    SeveralKept(Vec<String>),
    /// ONNX Runtime was asked for and is not there.
    #[error("{0}: name its library with --onnxruntime, or install it with pip")]
    NoOnnxRuntime(String),
    /// A network cannot be loaded.
    #[error(transparent)]
    Load(NetworkError),
    /// A network failed while running.
    #[error(transparent)]
    Run(NetworkError),
    /// The networks run, but do not match a pattern with itself.
    #[error("only {alike} of {keypoints} keypoints of a pattern match themselves")]
    Mismatch {
        /// Keypoints that were matched with themselves.
        alike: usize,
        /// All keypoints.
        keypoints: usize,
    },
    /// A record cannot be written as TOML.
    #[error("the record of the model cannot be written as TOML: {0}")]
    Record(String),
}

impl ModelsError {
    /// `path` cannot be read or understood.
    #[allow(clippy::needless_pass_by_value, reason = "callers hand over an error that they need no more")]
    pub(crate) fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }

    /// `path` cannot be written.
    #[allow(clippy::needless_pass_by_value, reason = "callers hand over an error that they need no more")]
    pub(crate) fn write(path: &Path, reason: impl ToString) -> Self {
        Self::Write { path: path.to_owned(), reason: reason.to_string() }
    }
}

fn kept_note(partial: bool) -> &'static str {
    if partial { ": the part that came is kept, try again" } else { "" }
}
