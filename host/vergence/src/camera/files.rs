//! Images from files: one file, or all images of a folder in the order of their names.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use image::RgbImage;

use super::{Camera, Frame, jpeg};
use crate::failure::Failure;

/// Image files, one after the other.
#[derive(Debug)]
pub struct FileCamera {
    files: VecDeque<PathBuf>,
}

impl FileCamera {
    /// The file at `path`, or every JPEG and PNG in the folder at `path`.
    ///
    /// # Errors
    /// Nothing there, or no image in the folder.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let missing = |error: std::io::Error| Failure::input(path, error);
        if !path.metadata().map_err(missing)?.is_dir() {
            return Ok(Self { files: VecDeque::from([path.to_owned()]) });
        }
        let mut files = Vec::new();
        for entry in path.read_dir().map_err(missing)? {
            let file = entry.map_err(missing)?.path();
            let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase());
            if matches!(extension.as_deref(), Some("jpg" | "jpeg" | "png")) {
                files.push(file);
            }
        }
        if files.is_empty() {
            return Err(Failure::input(path, "no JPEG or PNG image in this folder"));
        }
        files.sort();
        Ok(Self { files: files.into() })
    }

    /// How many frames are left.
    #[must_use]
    pub fn remaining(&self) -> usize {
        self.files.len()
    }
}

impl Camera for FileCamera {
    fn grab(&mut self) -> Result<Option<Frame>, Failure> {
        let Some(path) = self.files.pop_front() else { return Ok(None) };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Some(Frame { image: read_image(&path)?, name, seq: None, exposed_at: None }))
    }
}

/// Reads a JPEG or PNG whole; a truncated one is an error.
///
/// # Errors
/// Says which file and why.
pub fn read_image(path: &Path) -> Result<RgbImage, Failure> {
    let fail = |error: &dyn std::fmt::Display| Failure::input(path, format!("not a readable image: {error}"));
    let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
    if !jpeg::is_whole(&bytes) {
        return Err(fail(&"the file ends before the picture does; copy it again"));
    }
    Ok(image::load_from_memory(&bytes).map_err(|error| fail(&error))?.into_rgb8())
}
