//! Masks of cameras from files: a picture, or shapes in a text.

use std::path::Path;

use vergence_rig::{CameraMask, mask_of, mask_of_shapes};
use vergence_vision::{BodyMask, ImageSize};

use crate::CameraError;

/// The mask of a camera whose images are of `size`, read where it is a file.
///
/// # Errors
/// Those of [`read_mask`]; [`CameraError::Shapes`] where shapes are bad for this size.
pub fn camera_mask(mask: &CameraMask, size: ImageSize) -> Result<BodyMask, CameraError> {
    match mask {
        CameraMask::File(path) => read_mask(path, size),
        CameraMask::Shapes(shapes) => mask_of(shapes, size).map_err(CameraError::Shapes),
    }
}

/// The mask with the whole name of its file: right in a file that lies elsewhere, too.
#[must_use]
pub fn with_whole_name(mask: &CameraMask) -> CameraMask {
    match mask {
        // A name cannot be made whole where the current folder is gone.
        CameraMask::File(path) => CameraMask::File(std::path::absolute(path).unwrap_or_else(|_| path.clone())),
        shapes @ CameraMask::Shapes(_) => shapes.clone(),
    }
}

/// Reads what is left out of the images of a camera, which are of `size`: a TOML file of shapes (see [`mask_of_shapes`]), or a picture of
/// that size that is black there.
///
/// # Errors
/// [`CameraError::Unreadable`] where the file cannot be read, [`CameraError::Mask`] where its shapes are bad or the picture is of
/// another size.
pub fn read_mask(path: &Path, size: ImageSize) -> Result<BodyMask, CameraError> {
    let wrong = |why: String| CameraError::Mask { path: path.into(), why };
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        let unreadable = |error: std::io::Error| CameraError::Unreadable { path: path.into(), why: error.to_string() };
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        return mask_of_shapes(&text, size).map_err(|error| wrong(error.to_string()));
    }
    let unreadable = |error: image::ImageError| CameraError::Unreadable { path: path.into(), why: error.to_string() };
    let picture = image::open(path).map_err(unreadable)?.into_luma8();
    let given = ImageSize { width: picture.width(), height: picture.height() };
    if given != size {
        let (given, wanted) = ([given.width, given.height], [size.width, size.height]);
        return Err(wrong(format!(
            "the mask is {} x {}, its camera {} x {}",
            given[0], given[1], wanted[0], wanted[1]
        )));
    }
    let hidden = picture.pixels().map(|pixel| pixel.0[0] < 128).collect();
    BodyMask::new(size, hidden).ok_or_else(|| wrong("the mask has no pixels".into()))
}
