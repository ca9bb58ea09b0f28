//! Clouds as PCD 0.7, the format of the Point Cloud Library (R. B. Rusu and S. Cousins, ICRA 2011), binary, or in ASCII for a person to read.
//!
//! Numbers have single precision, because PCL's types of points take no other x, y and z.

use std::fmt::Write;

use vergence_pipeline::ColouredPoint;

use super::cells::{
    COLOUR_COLUMN, Cell, EXTRAPOLATED_COLUMN, TRACK_COLUMN, dense_cells, dense_columns, sparse_cells, sparse_columns,
};
use super::columns::{ABOUT_COVARIANCES, ABOUT_FRAME, ABOUT_SCORE, DenseRow};
use super::format::CloudEncoding;

/// SIZE and TYPE of the column of this name.
fn size_and_type(column: &str, encoding: CloudEncoding) -> (&'static str, &'static str) {
    match (column, encoding) {
        // PCL declares the bits of a colour a float, but in text an integer: as the digits of a float they would be lost.
        (COLOUR_COLUMN, CloudEncoding::Ascii) => ("4", "U"),
        (EXTRAPOLATED_COLUMN, _) => ("1", "U"),
        (TRACK_COLUMN, _) => ("4", "I"),
        _ => ("4", "F"),
    }
}

/// The columns of a PLY file of these points, but the colour as one number.
#[must_use]
pub fn pcd(points: &[ColouredPoint], encoding: CloudEncoding) -> Vec<u8> {
    let about = [ABOUT_FRAME, ABOUT_SCORE, ABOUT_COVARIANCES];
    let mut bytes = header(&about, &sparse_columns(), points.len(), encoding);
    points.iter().for_each(|point| row(sparse_cells(point), encoding, &mut bytes));
    bytes
}

/// Rows with the columns of the sparse cloud that a dense one has.
#[must_use]
pub fn dense_pcd(rows: &[DenseRow], encoding: CloudEncoding) -> Vec<u8> {
    let mut bytes = header(&[ABOUT_FRAME], &dense_columns(), rows.len(), encoding);
    rows.iter().for_each(|point| row(dense_cells(point), encoding, &mut bytes));
    bytes
}

/// Appends the cells of a point.
fn row(cells: impl Iterator<Item = Cell>, encoding: CloudEncoding, bytes: &mut Vec<u8>) {
    match encoding {
        CloudEncoding::Binary => cells.for_each(|cell| cell.binary(bytes)),
        CloudEncoding::Ascii => {
            let words: Vec<_> = cells.map(Cell::text).collect();
            bytes.extend_from_slice((words.join(" ") + "\n").as_bytes());
        }
    }
}

fn header(about: &[&str], columns: &[&str], points: usize, encoding: CloudEncoding) -> Vec<u8> {
    let (sizes, types): (Vec<_>, Vec<_>) = columns.iter().map(|column| size_and_type(column, encoding)).unzip();
    let counts = vec!["1"; columns.len()];
    let data = match encoding {
        CloudEncoding::Binary => "binary",
        CloudEncoding::Ascii => "ascii",
    };
    let mut text = "# .PCD v0.7 - Point Cloud Data file format\n".to_owned();
    // Writing to a String does not fail.
    about.iter().for_each(|line| _ = writeln!(text, "# {line}"));
    _ = write!(
        text,
        "VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {points}\nDATA {data}\n",
        columns.join(" "),
        sizes.join(" "),
        types.join(" "),
        counts.join(" ")
    );
    text.into_bytes()
}
