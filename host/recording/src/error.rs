//! Why a recording cannot be written or read.

use std::io;
use std::path::{Path, PathBuf};

use mcap::McapError;

/// Why a recording cannot be written or read. The text is a sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The folder holds something already.
    #[error("{}: there is something already; name a folder that does not exist or is empty", .0.display())]
    NotEmpty(PathBuf),
    /// The disk is full.
    #[error("{}: the disk is full; what was written until now can be replayed", .0.display())]
    DiskFull(PathBuf),
    /// The recording cannot be written.
    #[error("{}: the recording cannot be written: {why}", .file.display())]
    Write {
        /// Which file.
        file: PathBuf,
        /// Why.
        why: String,
    },
    /// The recording cannot be read.
    #[error("{}: the recording cannot be read: {why}", .file.display())]
    Read {
        /// Which file.
        file: PathBuf,
        /// Why.
        why: String,
    },
    /// An image or event in it is not as vergence writes it.
    #[error("{}: {what} is not as vergence writes it; replay needs a recording of vergence", .file.display())]
    Foreign {
        /// Which file.
        file: PathBuf,
        /// Which part of it.
        what: String,
    },
    /// It is no MCAP file.
    #[error("{}: this is no recording: an MCAP file begins otherwise", .0.display())]
    NoMcap(PathBuf),
    /// The recording has no rig file.
    #[error("{}: no rig file is attached; name one with --rig", .0.display())]
    NoRig(PathBuf),
    /// The rig file of the recording is wrong.
    #[error("{}: the attached rig file: {why}", .file.display())]
    Rig {
        /// Which recording.
        file: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The measuring of a recorded pair failed.
    #[error(transparent)]
    Live(#[from] vergence_live::LiveError),
}

impl RecordingError {
    /// `error` while `file` was being written.
    pub(crate) fn write(file: &Path, error: &McapError) -> Self {
        let is_full = matches!(error, McapError::Io(error) if error.kind() == io::ErrorKind::StorageFull);
        match is_full {
            true => Self::DiskFull(file.to_owned()),
            false => Self::Write { file: file.to_owned(), why: error.to_string() },
        }
    }

    pub(crate) fn read(file: &Path, why: impl std::fmt::Display) -> Self {
        Self::Read { file: file.to_owned(), why: why.to_string() }
    }

    pub(crate) fn foreign(file: &Path, what: impl Into<String>) -> Self {
        Self::Foreign { file: file.to_owned(), what: what.into() }
    }
}
