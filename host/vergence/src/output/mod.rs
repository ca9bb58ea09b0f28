//! Files that commands write: whole, or not at all.

mod cloud_pictures;
mod colour_map;
mod dense_pictures;
mod dense_ply;
mod depth_field_svg;
mod endings;
mod panels;
mod ply;
mod table;
mod target_sheet;
mod zones_plot;
mod zones_svg;

use std::io::Write;
use std::path::Path;

use image::{EncodableLayout, ImageBuffer, ImageFormat, PixelWithColorType};

pub use cloud_pictures::{depth_svg, error_svg, match_svg};
pub use dense_pictures::{confidence_image, dense_svg, range_image, sigma_image};
pub use dense_ply::{DenseRow, dense_ply};
pub use depth_field_svg::depth_field_svg;
pub use endings::{check_ending, check_folder};
pub use ply::ply;
pub use table::{Table, TableFormat};
pub use target_sheet::Sheet;
pub use zones_plot::{ZonesOf, zones_plot};
pub use zones_svg::{seen_by_cones, zones_svg};

use crate::failure::Failure;

/// Writes `bytes` to `path` through a temporary file beside it: whoever reads `path` sees the old file or the whole new one.
///
/// # Errors
/// Says which file and why.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let fail = |error: &dyn std::fmt::Display| Failure::output(path, error);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::Builder::new()
        .prefix(".vergence-")
        .permissions(readable_by_all())
        .tempfile_in(folder)
        .map_err(|error| fail(&error))?;
    file.write_all(bytes).map_err(|error| fail(&error))?;
    file.persist(path).map_err(|error| fail(&error.error))?;
    Ok(())
}

/// A temporary file would be private; the umask takes away what it must.
fn readable_by_all() -> std::fs::Permissions {
    std::os::unix::fs::PermissionsExt::from_mode(0o666)
}

/// Writes an image as PNG.
///
/// # Errors
/// Says which file and why.
pub fn write_png<P>(path: &Path, image: &ImageBuffer<P, Vec<P::Subpixel>>) -> Result<(), Failure>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
{
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|error| Failure::output(path, error))?;
    write_whole(path, bytes.get_ref())
}

/// Makes the folder at `path`, and those above it, where they are missing.
///
/// # Errors
/// Says which folder and why.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| Failure::output(path, error))
}
