//! The hash of the files that a calibration was made from.

use std::path::Path;

use sha2::{Digest, Sha256};
use vergence_files::FileError;
use vergence_rig::Provenance;

/// A SHA-256 over the contents of files, in the order in which they were added.
#[derive(Clone, Default)]
pub struct InputHash(Sha256);

impl InputHash {
    /// Takes the contents of the file at `path`.
    ///
    /// # Errors
    /// [`FileError::Read`].
    pub fn add(&mut self, path: &Path) -> Result<(), FileError> {
        let bytes = vergence_files::read(path)?;
        // The length keeps "ab" + "c" and "a" + "bc" apart.
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(&bytes);
        Ok(())
    }

    /// Says of a result of these files which program made it, of what, and when; `date` is as the user gave it.
    #[must_use]
    pub fn provenance(self, date: Option<&str>) -> Provenance {
        let hash = self.0.finalize();
        Provenance {
            program: concat!("vergence ", env!("CARGO_PKG_VERSION")).into(),
            inputs_sha256: hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            date: date.map(str::to_owned),
        }
    }
}
