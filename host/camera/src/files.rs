//! Images from files: one file, or all images of a folder in the order of their names.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use image::RgbImage;

use crate::bit_depth::in_eight_bits;
use crate::pairing::{PairedFiles, paired};
use crate::{Camera, CameraError, CameraImage, jpeg};

/// Folder with the images of one camera of an EuRoC or TUM-VI sequence.
const SEQUENCE_IMAGES: &str = "data";

/// Image files, one after the other.
#[derive(Debug)]
pub struct FileCamera {
    files: VecDeque<PathBuf>,
}

impl FileCamera {
    /// The file at `path`, or every JPEG and PNG in the folder at `path`.
    ///
    /// # Errors
    /// [`CameraError::Unreadable`] or [`CameraError::NoImages`].
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        Ok(Self { files: image_files(path)?.into() })
    }

    /// Number of images left.
    #[must_use]
    pub fn remaining(&self) -> usize {
        self.files.len()
    }

    /// Opens the images of the left and of the right camera, two files or two folders, so that both give the images of a pair in
    /// turn. Returns the images without a partner too.
    ///
    /// # Errors
    /// As [`Self::open`]; [`CameraError::Unpaired`] where nothing says which images belong together.
    pub fn open_pair(left: &Path, right: &Path) -> Result<([Self; 2], Vec<PathBuf>), CameraError> {
        let PairedFiles { pairs, alone } = paired(&image_files(left)?, &image_files(right)?)?;
        let (left, right) = pairs.into_iter().map(|[left, right]| (left, right)).unzip();
        Ok(([Self { files: left }, Self { files: right }], alone))
    }

    /// The next images of both cameras of a pair, read at the same time; `None` after the last pair.
    ///
    /// # Errors
    /// As [`read_image`].
    pub fn grab_pair([left, right]: &mut [Self; 2]) -> Result<Option<[CameraImage; 2]>, CameraError> {
        let (left, right) = rayon::join(|| left.grab(), || right.grab());
        Ok(left?.zip(right?).map(<[_; 2]>::from))
    }
}

impl Camera for FileCamera {
    fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
        let Some(path) = self.files.pop_front() else { return Ok(None) };
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Some(CameraImage { image: read_image(&path)?, name, seq: None, exposed_at: None, bytes: None }))
    }
}

/// The file at `path`, or every JPEG and PNG in the folder at `path`, in the order of their names. A folder without images is
/// that of a camera in an EuRoC or TUM-VI sequence, such as mav0/cam0, if it has a folder `data`: then it is that one's images.
///
/// # Errors
/// [`CameraError::Unreadable`] where nothing is there, [`CameraError::NoImages`] for a folder without images.
pub fn image_files(path: &Path) -> Result<Vec<PathBuf>, CameraError> {
    let unreadable = |error: std::io::Error| CameraError::Unreadable { path: path.into(), why: error.to_string() };
    if !path.metadata().map_err(unreadable)?.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let inner = path.join(SEQUENCE_IMAGES);
    for folder in [path, &inner] {
        let files = images_in(folder).unwrap_or_default();
        if !files.is_empty() {
            return Ok(files);
        }
    }
    // An unreadable folder has its own reason.
    images_in(path).map_err(unreadable)?;
    Err(CameraError::NoImages(path.into()))
}

/// Every JPEG and PNG in `folder`, in the order of their names.
fn images_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in folder.read_dir()? {
        let file = entry?.path();
        let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase());
        if matches!(extension.as_deref(), Some("jpg" | "jpeg" | "png")) {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

/// Reads a JPEG or PNG image, of 16 bits per channel too: the upper 8 of those that it uses are kept.
///
/// # Errors
/// [`CameraError::Unreadable`] where the file cannot be read, [`CameraError::NotAnImage`] where it is damaged or truncated.
pub fn read_image(path: &Path) -> Result<RgbImage, CameraError> {
    let not_an_image = |why: String| CameraError::NotAnImage { path: path.into(), why };
    let bytes =
        std::fs::read(path).map_err(|error| CameraError::Unreadable { path: path.into(), why: error.to_string() })?;
    if !jpeg::is_whole(&bytes) {
        return Err(not_an_image("the file ends before the picture does; copy it again".into()));
    }
    let image = image::load_from_memory(&bytes).map_err(|error| not_an_image(error.to_string()))?;
    Ok(in_eight_bits(image))
}
