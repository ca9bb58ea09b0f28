//! Pictures as SVG and PNG: clouds, dense ranges, the predicted error of depth, zones, a trunk on its
//! path.

mod cloud;
mod dense;
mod depth_field;
mod depth_view;
mod panels;
mod trunk_strip;
mod virtual_view;
mod zones_curves;
mod zones_plan;

use std::path::Path;

use image::ImageError;
use vergence_files::{FileError, write_whole};

pub use cloud::{depth_svg, error_svg, match_svg, write_scored_pair};
pub use dense::{confidence_image, dense_svg, range_image, sigma_image};
pub use depth_field::depth_field_svg;
pub use depth_view::{DepthView, makes_a_point};
pub use trunk_strip::trunk_strip_svg;
pub use virtual_view::{EXACT_AT, ViewMap, view_yaml};
pub use zones_curves::{ZonesOf, zones_plot};
pub use zones_plan::{seen_by_cones, zones_svg};

/// Writes a drawing to `path`, unless one of its images could not be encoded.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_drawing(path: &Path, drawn: Result<String, ImageError>) -> Result<(), FileError> {
    let svg = drawn.map_err(|error| FileError::write(path, error))?;
    write_whole(path, svg.as_bytes())
}
