//! Clouds and bearings as files for other programs: PLY and tables.

mod ply;
mod table;

use std::path::Path;

use vergence_files::{FileError, write_whole};
use vergence_pipeline::ColouredPoint;

pub use ply::{DenseRow, PlyEncoding, dense_ply, ply};
pub use table::{Table, TableFormat};

/// Writes `points` to `out` as PLY, and beside it as a table in each of `formats`.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_cloud(
    out: &Path,
    points: &[ColouredPoint],
    encoding: PlyEncoding,
    formats: impl IntoIterator<Item = TableFormat>,
) -> Result<(), FileError> {
    write_whole(out, &ply(points, encoding))?;
    for format in formats {
        let table = Table::of_points(points).text(format);
        write_whole(&out.with_extension(format.extension()), table.as_bytes())?;
    }
    Ok(())
}
