//! Clouds and bearings as files for other programs: PLY, PCD and tables.

mod columns;
mod format;
mod pcd;
mod ply;
mod table;

use std::path::Path;

use vergence_files::{FileError, write_whole};
use vergence_pipeline::ColouredPoint;

pub use columns::DenseRow;
pub use format::{CloudEncoding, CloudFormat};
pub use table::{Table, TableFormat};

/// Writes `points` to `out` in the format that its ending says, and beside it as a table in each of `formats`.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_cloud(
    out: &Path,
    points: &[ColouredPoint],
    encoding: CloudEncoding,
    formats: impl IntoIterator<Item = TableFormat>,
) -> Result<(), FileError> {
    write_whole(out, &CloudFormat::of_file(out).cloud(points, encoding))?;
    for format in formats {
        let table = Table::of_points(points).text(format);
        write_whole(&out.with_extension(format.extension()), table.as_bytes())?;
    }
    Ok(())
}
