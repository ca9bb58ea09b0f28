//! The file in which what images told of the pose in each mode outlives the live loop.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use vergence_files::{FileError, read_text, write_whole};
use vergence_image::sha256;
use vergence_pipeline::PoseMemory;
use vergence_rig::{Provenance, Rig, StoredPoses, StoredPosesError};

/// A file of stored poses, and the memory of the live loop that uses it.
#[derive(Debug)]
pub struct KeptPoses {
    file: PathBuf,
    /// What the file holds.
    written: StoredPoses,
    memory: Arc<Mutex<PoseMemory>>,
}

/// Why a file of stored poses is not used. The text is a sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeptPosesError {
    /// It cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// It holds something else.
    #[error("{}: it {why}", .file.display())]
    Stored {
        /// The file.
        file: PathBuf,
        /// Why it is not used.
        why: StoredPosesError,
    },
    /// The rig or the poses cannot be written as text.
    #[error("{}: nothing can be kept of this rig: {why}", .file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// Why not.
        why: String,
    },
}

impl KeptPoses {
    /// Reads `file`, which need not be there yet. It belongs to the rig as its file describes it, comments aside.
    ///
    /// # Errors
    /// [`KeptPosesError`].
    pub fn open(file: &Path, rig: &Rig) -> Result<Self, KeptPosesError> {
        let nobody = Provenance { program: String::new(), inputs_sha256: String::new(), date: None };
        let text = rig.to_toml(&nobody).map_err(|error| unwritable(file, &error))?;
        let hash: String = sha256(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
        let stored = match file.exists() {
            false => StoredPoses::none(&hash),
            true => StoredPoses::from_toml(&read_text(file)?, &hash)
                .map_err(|why| KeptPosesError::Stored { file: file.to_owned(), why })?,
        };
        let memory = Arc::new(Mutex::new(PoseMemory::of_visits(stored.clone())));
        Ok(Self { file: file.to_owned(), written: stored, memory })
    }

    /// The memory of a live loop that goes on from the file.
    #[must_use]
    pub fn memory(&self) -> Arc<Mutex<PoseMemory>> {
        Arc::clone(&self.memory)
    }

    /// Writes what the live loop has learned, whole or not at all; nothing where it learned nothing.
    ///
    /// # Errors
    /// [`KeptPosesError`].
    pub fn write(&self) -> Result<(), KeptPosesError> {
        let stored = self.memory.lock().unwrap_or_else(PoisonError::into_inner).stored.clone();
        if stored == self.written {
            return Ok(());
        }
        let text = stored.to_toml().map_err(|error| unwritable(&self.file, &error))?;
        Ok(write_whole(&self.file, text.as_bytes())?)
    }
}

fn unwritable(file: &Path, error: &dyn std::fmt::Display) -> KeptPosesError {
    KeptPosesError::Unwritable { file: file.to_owned(), why: error.to_string() }
}
