//! Clouds as PCD 0.7, the format of the Point Cloud Library (R. B. Rusu and S. Cousins, ICRA 2011), binary, or in ASCII for a person to read.
//!
//! Numbers have single precision, because PCL's types of points take no other x, y and z.

use std::fmt::Write;

use vergence_pipeline::ColouredPoint;

use super::columns::{
    ABOUT_COVARIANCES, ABOUT_FRAME, ABOUT_SCORE, COVARIANCE_COLUMNS, DenseRow, covariances, pixels_and_sigma,
    track_number,
};
use super::format::CloudEncoding;

const POINT_COLUMNS: [&str; 3] = ["x", "y", "z"];
const COLOUR_COLUMN: &str = "rgb";
const PIXEL_COLUMNS: [&str; 5] = ["u_left", "v_left", "u_right", "v_right", "sigma_range"];
const SCORE_COLUMN: &str = "score";
const EXTRAPOLATED_COLUMN: &str = "extrapolated";
const TRACK_COLUMN: &str = "track";

/// A value of a row.
#[derive(Clone, Copy)]
enum Cell {
    Number(f32),
    /// One number, 0x00RRGGBB.
    Colour([u8; 3]),
    Flag(bool),
    Track(i32),
}

impl Cell {
    fn binary(self, bytes: &mut Vec<u8>) {
        match self {
            Self::Number(value) => bytes.extend_from_slice(&value.to_le_bytes()),
            Self::Colour(colour) => bytes.extend_from_slice(&packed(colour).to_le_bytes()),
            Self::Flag(flag) => bytes.push(flag.into()),
            Self::Track(track) => bytes.extend_from_slice(&track.to_le_bytes()),
        }
    }

    fn text(self) -> String {
        match self {
            Self::Number(value) => value.to_string(),
            Self::Colour(colour) => packed(colour).to_string(),
            Self::Flag(flag) => u8::from(flag).to_string(),
            Self::Track(track) => track.to_string(),
        }
    }
}

fn packed([red, green, blue]: [u8; 3]) -> u32 {
    u32::from_be_bytes([0, red, green, blue])
}

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
    let columns = [
        &POINT_COLUMNS[..],
        &[COLOUR_COLUMN],
        &PIXEL_COLUMNS,
        &[SCORE_COLUMN],
        &COVARIANCE_COLUMNS,
        &[EXTRAPOLATED_COLUMN, TRACK_COLUMN],
    ]
    .concat();
    let mut bytes = header(&[ABOUT_FRAME, ABOUT_SCORE, ABOUT_COVARIANCES], &columns, points.len(), encoding);
    for point in points {
        let cells = cells(point);
        match encoding {
            CloudEncoding::Binary => cells.for_each(|cell| cell.binary(&mut bytes)),
            CloudEncoding::Ascii => {
                let words: Vec<_> = cells.map(Cell::text).collect();
                bytes.extend_from_slice((words.join(" ") + "\n").as_bytes());
            }
        }
    }
    bytes
}

fn cells(ColouredPoint { point, colour, score, track }: &ColouredPoint) -> impl Iterator<Item = Cell> {
    let at = point.point.mm();
    let single = |value: f64| Cell::Number(value as f32);
    [at.x, at.y, at.z]
        .map(single)
        .into_iter()
        .chain([Cell::Colour(*colour)])
        .chain(pixels_and_sigma(point).map(single))
        .chain([Cell::Number(*score)])
        .chain(covariances(point).map(single))
        .chain([Cell::Flag(point.extrapolated), Cell::Track(track_number(*track))])
}

/// Rows with the columns of the sparse cloud that a dense one has, little-endian.
#[must_use]
pub fn dense_pcd(rows: &[DenseRow]) -> Vec<u8> {
    let columns = [&POINT_COLUMNS[..], &[COLOUR_COLUMN], &PIXEL_COLUMNS, &[EXTRAPOLATED_COLUMN]].concat();
    let mut bytes = header(&[ABOUT_FRAME], &columns, rows.len(), CloudEncoding::Binary);
    for DenseRow { point, colour, pixels, sigma, extrapolated } in rows {
        point
            .map(Cell::Number)
            .into_iter()
            .chain([Cell::Colour(*colour)])
            .chain(pixels.map(Cell::Number))
            .chain([Cell::Number(*sigma), Cell::Flag(*extrapolated)])
            .for_each(|cell| cell.binary(&mut bytes));
    }
    bytes
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
