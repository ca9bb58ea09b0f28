//! Where a calibration comes from: program, inputs, date.

use std::path::Path;

use sha2::{Digest, Sha256};
use vergence_rig::Provenance;

use crate::failure::Failure;

/// A hash over files, in their order.
#[derive(Clone, Default)]
pub struct InputHash(Sha256);

impl InputHash {
    /// Takes the contents of `path`.
    ///
    /// # Errors
    /// Where the file cannot be read.
    pub fn add(&mut self, path: &Path) -> Result<(), Failure> {
        let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
        // The length keeps "ab" + "c" and "a" + "bc" apart.
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(&bytes);
        Ok(())
    }

    /// The provenance of a result of these inputs.
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
