//! Clouds as E57 (ASTM E2807), which knows metres alone: place and colour by the standard, all other columns as an extension in the units of PLY and PCD.

use std::io::Cursor;

use ::e57::{E57Writer, Extension, Record, RecordDataType, RecordName, RecordValue};
use sha2::{Digest, Sha256};
use vergence_pipeline::ColouredPoint;

use super::cells::{Cell, EXTRAPOLATED_COLUMN, TRACK_COLUMN, dense_cells, dense_columns, sparse_cells, sparse_columns};
use super::columns::{ABOUT_COVARIANCES, ABOUT_SCORE, DenseRow};

/// Columns before those of the extension: x, y, z and the colour.
const OWN: usize = 4;
/// Metres in a millimetre.
const MM: f64 = 1e-3;
/// Prefix and name of the extension.
const EXTENSION: [&str; 2] = ["vergence", "urn:vergence:cloud:1"];
const ABOUT: &str =
    "the left camera's frame: x right, y down, z forward, in metres; in the extension pixels, millimetres and mm^2";

/// The columns of a PLY file of these points.
pub fn sparse_e57(points: &[ColouredPoint]) -> ::e57::Result<Vec<u8>> {
    let about = [ABOUT, ABOUT_SCORE, ABOUT_COVARIANCES].join("; ");
    let rows = points.iter().map(|point| (point.point.point.mm().into(), point.colour, sparse_cells(point)));
    file(&about, &sparse_columns(), rows)
}

/// Rows with the columns of the sparse cloud that a dense one has.
pub fn dense_e57(rows: &[DenseRow]) -> ::e57::Result<Vec<u8>> {
    let rows = rows.iter().map(|row| (row.point.map(f64::from), row.colour, dense_cells(row)));
    file(ABOUT, &dense_columns(), rows)
}

fn file<C: Iterator<Item = Cell>>(
    about: &str,
    columns: &[&str],
    rows: impl Iterator<Item = ([f64; 3], [u8; 3], C)> + Clone,
) -> ::e57::Result<Vec<u8>> {
    // A name that no other cloud has, and the same for the same cloud.
    let mut hash = Sha256::new();
    rows.clone().flat_map(|(at, ..)| at).for_each(|value: f64| hash.update(value.to_le_bytes()));
    let name: String = hash.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, &format!("vergence-{name}"))?;
    let [prefix, url] = EXTENSION;
    writer.register_extension(Extension::new(prefix, url))?;
    let place = [Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
    let colour = [Record::COLOR_RED_U8, Record::COLOR_GREEN_U8, Record::COLOR_BLUE_U8];
    let prototype = place.into_iter().chain(colour).chain(columns[OWN..].iter().map(|column| record(column)));
    let mut cloud = writer.add_pointcloud(&format!("vergence-cloud-{name}"), prototype.collect())?;
    cloud.set_name(Some("cloud".to_owned()));
    cloud.set_description(Some(about.to_owned()));
    for (at, colour, cells) in rows {
        let place = at.map(|mm| RecordValue::Double(mm * MM));
        let colour = colour.map(|channel| RecordValue::Integer(channel.into()));
        cloud.add_point(place.into_iter().chain(colour).chain(cells.skip(OWN).map(value)).collect())?;
    }
    cloud.finalize()?;
    writer.finalize()?;
    drop(writer);
    Ok(bytes.into_inner())
}

/// A column of the extension.
fn record(column: &str) -> Record {
    let name = RecordName::Unknown { namespace: EXTENSION[0].to_owned(), name: column.to_owned() };
    let data_type = match column {
        EXTRAPOLATED_COLUMN => RecordDataType::Integer { min: 0, max: 1 },
        TRACK_COLUMN => RecordDataType::Integer { min: -1, max: i32::MAX.into() },
        _ => RecordDataType::Single { min: None, max: None },
    };
    Record { name, data_type }
}

fn value(cell: Cell) -> RecordValue {
    match cell {
        Cell::Number(value) => RecordValue::Single(value),
        // No column of the extension.
        Cell::Colour([red, green, blue]) => RecordValue::Integer(u32::from_be_bytes([0, red, green, blue]).into()),
        Cell::Flag(flag) => RecordValue::Integer(flag.into()),
        Cell::Track(track) => RecordValue::Integer(track.into()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use ::e57::E57Reader;

    use super::*;

    #[test]
    fn a_cloud_is_the_same_bytes_each_time_and_holds_its_points() {
        let row = DenseRow {
            point: [1250.0, -2.5, 9e6],
            colour: [1, 2, 255],
            pixels: [3.0; 4],
            sigma: 0.5,
            extrapolated: true,
        };
        let bytes = dense_e57(&[row]).expect("a file");
        assert_eq!(bytes, dense_e57(&[row]).expect("a file"));
        let mut reader = E57Reader::new(Cursor::new(bytes)).expect("it is read");
        let cloud = reader.pointclouds().first().cloned().expect("a cloud");
        let points: Vec<_> =
            reader.pointcloud_raw(&cloud).expect("it is read").map(|point| point.expect("a point")).collect();
        assert_eq!(points.len(), 1);
        let expected = [RecordValue::Double(1.25), RecordValue::Double(-0.0025), RecordValue::Double(9000.0)];
        assert_eq!(points[0][..3], expected);
        assert_eq!(points[0][3..6], [1, 2, 255].map(RecordValue::Integer));
        assert_eq!(points[0][10..], [RecordValue::Single(0.5), RecordValue::Integer(1)]);
        assert!(E57Reader::new(Cursor::new(dense_e57(&[]).expect("a file"))).is_ok());
    }
}
