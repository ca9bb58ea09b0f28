//! Clouds and bearings as files for other programs: PLY, PCD, LAS, E57 and tables.

mod cells;
mod columns;
mod e57;
mod format;
mod las;
mod pcd;
mod ply;
mod table;

use std::path::Path;

use vergence_files::{FileError, write_whole};
use vergence_pipeline::ColouredPoint;

pub use columns::DenseRow;
pub use format::{CloudEncoding, CloudError, CloudFormat};
pub use table::{Table, TableFormat};

/// Writes `points` to `out` in the format that its ending says, as text where it `is_ascii`, and beside it as a table in each of `formats`.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_cloud(
    out: &Path,
    points: &[ColouredPoint],
    is_ascii: bool,
    formats: impl IntoIterator<Item = TableFormat>,
) -> Result<(), FileError> {
    let format = CloudFormat::of_file(out);
    let bytes = format.encoding(is_ascii).and_then(|encoding| format.cloud(points, encoding));
    let bytes = bytes.map_err(|error| FileError::write(out, error))?;
    write_whole(out, &bytes)?;
    for format in formats {
        let table = Table::of_points(points).text(format);
        write_whole(&out.with_extension(format.extension()), table.as_bytes())?;
    }
    Ok(())
}
