//! Clouds as LAS 1.4 (ASPRS, 2019), point format 2: coordinates and colour, and all other columns as extra bytes.
//!
//! LAS is in use for surveys, in metres and with z up. These files say that they are not: millimetres in the frame of the left camera, as in PLY and PCD.

use std::io::Cursor;

use ::las::point::Format;
use ::las::{Builder, Color, Point, Transform, Vector, Vlr, Writer};
use vergence_pipeline::ColouredPoint;

use super::cells::{Cell, EXTRAPOLATED_COLUMN, TRACK_COLUMN, dense_cells, dense_columns, sparse_cells, sparse_columns};
use super::columns::{ABOUT_COVARIANCES, ABOUT_FRAME, ABOUT_SCORE, DenseRow};

/// Columns before those in extra bytes: x, y, z and the colour.
const OWN: usize = 4;
/// The finest step of coordinates in millimetres. 32 bits of it reach 2 km.
const FINEST_MM: f64 = 1e-3;
/// User and number of the records that LAS defines: a text, the extra bytes, the coordinate system.
const SPECIFICATION: &str = "LASF_Spec";
const TEXT: u16 = 3;
const EXTRA_BYTES: u16 = 4;
const PROJECTION: &str = "LASF_Projection";
const COORDINATE_SYSTEM: u16 = 2112;
/// Well-known text (OGC 01-009) of a system that is bound to no place on Earth.
const LOCAL_MM: &str = "LOCAL_CS[\"left camera, x right, y down, z forward\",UNIT[\"millimetre\",0.001]]\0";

/// The columns of a PLY file of these points.
pub fn sparse_las(points: &[ColouredPoint]) -> ::las::Result<Vec<u8>> {
    let about = [ABOUT_FRAME, ABOUT_SCORE, ABOUT_COVARIANCES].join("; ");
    let rows = points.iter().map(|point| (point.point.point.mm().into(), point.colour, sparse_cells(point)));
    file(&about, &sparse_columns(), rows)
}

/// Rows with the columns of the sparse cloud that a dense one has.
pub fn dense_las(rows: &[DenseRow]) -> ::las::Result<Vec<u8>> {
    let rows = rows.iter().map(|row| (row.point.map(f64::from), row.colour, dense_cells(row)));
    file(ABOUT_FRAME, &dense_columns(), rows)
}

fn file<C: Iterator<Item = Cell>>(
    about: &str,
    columns: &[&str],
    rows: impl Iterator<Item = ([f64; 3], [u8; 3], C)> + Clone,
) -> ::las::Result<Vec<u8>> {
    let extra = &columns[OWN..];
    let record = |user: &str, record_id, data| Vlr { user_id: user.to_owned(), record_id, data, ..Vlr::default() };
    let mut header = Builder::from((1, 4));
    header.generating_software = concat!("vergence ", env!("CARGO_PKG_VERSION")).to_owned();
    header.point_format = Format { extra_bytes: extra.iter().map(|column| kind(column).1).sum(), ..Format::new(2)? };
    header.has_wkt_crs = true;
    header.vlrs = vec![
        record(PROJECTION, COORDINATE_SYSTEM, LOCAL_MM.into()),
        record(SPECIFICATION, TEXT, about.into()),
        record(SPECIFICATION, EXTRA_BYTES, extra.iter().flat_map(|column| described(column)).collect()),
    ];
    let farthest = rows.clone().flat_map(|(at, ..)| at).fold(0.0, |most: f64, at| most.max(at.abs()));
    let step = Transform { scale: step_for(farthest), offset: 0.0 };
    header.transforms = Vector { x: step, y: step, z: step };
    let mut writer = Writer::new(Cursor::new(Vec::new()), header.into_header()?)?;
    for ([x, y, z], colour, cells) in rows {
        let mut extra_bytes = Vec::new();
        cells.skip(OWN).for_each(|cell| cell.binary(&mut extra_bytes));
        // LAS wants colours of 8 bits times 256.
        let [red, green, blue] = colour.map(|channel| u16::from(channel) << 8);
        let color = Some(Color { red, green, blue });
        writer.write_point(Point {
            x,
            y,
            z,
            return_number: 1,
            number_of_returns: 1,
            color,
            extra_bytes,
            ..Point::default()
        })?;
    }
    Ok(writer.into_inner()?.into_inner())
}

/// The step of coordinates that reaches so far: a power of ten.
fn step_for(farthest_mm: f64) -> f64 {
    let mut step = FINEST_MM;
    while farthest_mm > step * f64::from(i32::MAX) && step < 1e6 {
        step *= 10.0;
    }
    step
}

/// The type of an extra column as LAS counts them, and its bytes.
fn kind(column: &str) -> (u8, u16) {
    match column {
        EXTRAPOLATED_COLUMN => (1, 1),
        TRACK_COLUMN => (6, 4),
        _ => (9, 4),
    }
}

/// The 192 bytes that describe an extra column: type, name, unit.
fn described(column: &str) -> [u8; 192] {
    const NAME: usize = 4;
    const DESCRIPTION: usize = 160;
    let unit = match column {
        EXTRAPOLATED_COLUMN | TRACK_COLUMN | "score" => "",
        "sigma_range" => "mm",
        _ if column.starts_with("cov_") || column.starts_with("own_") => "mm^2",
        _ => "pixels",
    };
    let mut bytes = [0; 192];
    bytes[2] = kind(column).0;
    bytes[NAME..NAME + column.len()].copy_from_slice(column.as_bytes());
    bytes[DESCRIPTION..DESCRIPTION + unit.len()].copy_from_slice(unit.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use ::las::Reader;

    use super::*;

    fn row(z: f32) -> DenseRow {
        DenseRow { point: [1.25, -2.5, z], colour: [1, 2, 255], pixels: [3.0; 4], sigma: 0.5, extrapolated: true }
    }

    #[test]
    fn near_points_are_kept_to_a_micrometre_and_far_ones_at_all() {
        for (z, tolerance) in [(350.0, 1e-3), (9e6, 1.0)] {
            let bytes = dense_las(&[row(z), row(10.0)]).expect("a file");
            let mut reader = Reader::new(Cursor::new(bytes)).expect("it is read");
            let data = reader.read_all().expect("points");
            let points: Vec<_> = data.points().map(|point| point.expect("a point")).collect();
            assert_eq!(points.len(), 2);
            assert!((points[0].z - f64::from(z)).abs() <= tolerance && (points[0].x - 1.25).abs() <= tolerance);
            assert_eq!(points[0].color, Some(Color { red: 256, green: 512, blue: 65280 }));
            assert_eq!((points[0].extra_bytes.len(), points[0].extra_bytes[20]), (21, 1));
        }
        assert!(Reader::new(Cursor::new(dense_las(&[]).expect("a file"))).is_ok());
    }
}
