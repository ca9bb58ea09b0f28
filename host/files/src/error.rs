//! Why a file cannot be read or written.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Why a file or folder cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// A file or folder cannot be read.
    #[error("{}: {why}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        why: String,
    },
    /// A file or folder cannot be written.
    #[error("cannot write {}: {why}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason, or why nothing is written.
        why: String,
    },
}

impl FileError {
    /// `path` cannot be read.
    pub fn read(path: &Path, why: impl Display) -> Self {
        Self::Read { path: path.to_owned(), why: why.to_string() }
    }

    /// `path` cannot be written.
    pub fn write(path: &Path, why: impl Display) -> Self {
        Self::Write { path: path.to_owned(), why: why.to_string() }
    }
}
