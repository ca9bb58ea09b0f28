//! Files: read with errors that name them, and written whole or not at all.
//!
//! [`write_whole`] goes through a temporary file beside the target: whoever reads the target sees the old file or the whole
//! new one.

mod error;
mod folder;

use std::fs::Permissions;
use std::io::{Cursor, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use image::{EncodableLayout, ImageBuffer, ImageFormat, PixelWithColorType};

pub use error::FileError;
pub use folder::WholeFolder;

/// The bytes of the file at `path`.
///
/// # Errors
/// [`FileError::Read`].
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    std::fs::read(path).map_err(|error| FileError::read(path, error))
}

/// The text of the file at `path`, which must be UTF-8.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_text(path: &Path) -> Result<String, FileError> {
    std::fs::read_to_string(path).map_err(|error| FileError::read(path, error))
}

/// Writes `bytes` to `path` through a temporary file beside it: whoever reads `path` sees the old file or the whole new one.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::Builder::new()
        .prefix(".vergence-")
        .permissions(readable_by_all())
        .tempfile_in(folder)
        .map_err(|error| FileError::write(path, error))?;
    file.write_all(bytes).map_err(|error| FileError::write(path, error))?;
    file.persist(path).map_err(|error| FileError::write(path, error.error))?;
    Ok(())
}

/// A temporary file would be private; the umask takes away what it must.
fn readable_by_all() -> Permissions {
    Permissions::from_mode(0o666)
}

/// Writes `image` to `path` as PNG, whole or not at all.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_png<P>(path: &Path, image: &ImageBuffer<P, Vec<P::Subpixel>>) -> Result<(), FileError>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
{
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|error| FileError::write(path, error))?;
    write_whole(path, bytes.get_ref())
}

/// Makes the folder at `path`, and those above it, where they are missing.
///
/// # Errors
/// [`FileError::Write`].
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    std::fs::create_dir_all(path).map_err(|error| FileError::write(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_written_whole_and_readable_by_all() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        write_whole(&path, b"old").and_then(|()| write_whole(&path, b"new")).expect("written");
        assert_eq!(read_text(&path).as_deref(), Ok("new"));
        let mode = std::fs::metadata(&path).expect("there").permissions().mode();
        assert_eq!(mode & 0o400, 0o400);
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "no temporary file is left");
    }

    #[test]
    fn errors_name_the_file() {
        let path = Path::new("/nowhere/file");
        assert!(read(path).is_err_and(|error| error.to_string().starts_with("/nowhere/file: ")));
        let refused = write_whole(path, b"").expect_err("no such folder").to_string();
        assert!(refused.starts_with("cannot write /nowhere/file: "), "{refused}");
    }
}
