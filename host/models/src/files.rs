//! Files of the store: read, written whole, deleted; and the digest that tells them apart.

use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::ModelsError;

/// The bytes of the file at `path`.
pub fn read(path: &Path) -> Result<Vec<u8>, ModelsError> {
    std::fs::read(path).map_err(|error| ModelsError::read(path, error))
}

/// Writes `bytes` to `path` through a temporary file beside it: a reader of `path` sees the old file or the whole new one.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ModelsError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // A temporary file would be private; the umask takes away what it must.
    let mut file = tempfile::Builder::new()
        .prefix(".vergence-")
        .permissions(std::fs::Permissions::from_mode(0o666))
        .tempfile_in(folder)
        .map_err(|error| ModelsError::write(path, error.kind()))?;
    file.write_all(bytes).map_err(|error| ModelsError::write(path, error))?;
    file.persist(path).map_err(|error| ModelsError::write(path, error.error))?;
    Ok(())
}

/// Makes the folder at `path`, and those above it, where they are missing.
pub fn make_folder(path: &Path) -> Result<(), ModelsError> {
    std::fs::create_dir_all(path).map_err(|error| ModelsError::write(path, error))
}

/// Deletes the file at `path`.
pub fn remove(path: &Path) -> Result<(), ModelsError> {
    std::fs::remove_file(path).map_err(|error| ModelsError::write(path, error))
}

/// SHA-256 in hexadecimal.
pub fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
