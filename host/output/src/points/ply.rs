//! Clouds as PLY (G. Turk, Stanford, 1994), binary, or in ASCII for a person to read.

use std::fmt::Write;

use vergence_pipeline::ColouredPoint;

use super::columns::{
    ABOUT_COVARIANCES, ABOUT_FRAME, ABOUT_SCORE, COVARIANCE_COLUMNS, DenseRow, covariances, pixels_and_sigma,
    track_number,
};
use super::format::CloudEncoding;

/// The column that is 1 where a lens is extrapolated.
const EXTRAPOLATED_PROPERTY: &str = "property uchar extrapolated\n";
/// The last column: the number of the track, -1 without one. After 2^31 tracks the numbers begin anew.
const TRACK_PROPERTY: &str = "property int track\n";

/// The points in the left camera's frame, in millimetres, with colour, pixels in both images, sigma of the range, the probability that
/// the match is right (score), the upper triangles of the covariance and of the part of it that comes from the point's own pixels, and
/// whether a lens is extrapolated there, and the number of the track.
#[must_use]
pub fn ply(points: &[ColouredPoint], encoding: CloudEncoding) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {} 1.0\ncomment {ABOUT_FRAME}\ncomment {ABOUT_SCORE}\ncomment {ABOUT_COVARIANCES}\n\
         element vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property double u_left\nproperty double v_left\nproperty double u_right\nproperty double v_right\n\
         property double sigma_range\nproperty float score\n{}{EXTRAPOLATED_PROPERTY}{TRACK_PROPERTY}end_header\n",
        name(encoding),
        points.len(),
        COVARIANCE_COLUMNS.map(|name| format!("property float {name}\n")).concat()
    )
    .into_bytes();
    for point in points {
        match encoding {
            CloudEncoding::Binary => binary_row(point, &mut bytes),
            CloudEncoding::Ascii => bytes.extend_from_slice(text_row(point).as_bytes()),
        }
    }
    bytes
}

fn binary_row(ColouredPoint { point, colour, score, track }: &ColouredPoint, bytes: &mut Vec<u8>) {
    let at = point.point.mm();
    [at.x, at.y, at.z].iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    bytes.extend_from_slice(colour);
    pixels_and_sigma(point).iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    bytes.extend_from_slice(&score.to_le_bytes());
    covariances(point).iter().for_each(|value| bytes.extend_from_slice(&(*value as f32).to_le_bytes()));
    bytes.push(point.extrapolated.into());
    bytes.extend_from_slice(&track_number(*track).to_le_bytes());
}

fn text_row(ColouredPoint { point, colour: [red, green, blue], score, track }: &ColouredPoint) -> String {
    let at = point.point.mm();
    let mut row = format!("{:.4} {:.4} {:.4} {red} {green} {blue}", at.x, at.y, at.z);
    // Writing to a String does not fail.
    pixels_and_sigma(point).iter().for_each(|value| _ = write!(row, " {value:.4}"));
    _ = write!(row, " {score:.4}");
    covariances(point).iter().for_each(|value| _ = write!(row, " {value:.5e}"));
    _ = writeln!(row, " {} {}", u8::from(point.extrapolated), track_number(*track));
    row
}

/// Rows with the columns of the sparse cloud, in single precision.
#[must_use]
pub fn dense_ply(rows: &[DenseRow], encoding: CloudEncoding) -> Vec<u8> {
    const ROW_BYTES: usize = 36;
    let header = format!(
        "ply\nformat {} 1.0\ncomment {ABOUT_FRAME}\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float u_left\nproperty float v_left\nproperty float u_right\nproperty float v_right\n\
         property float sigma_range\n{EXTRAPOLATED_PROPERTY}end_header\n",
        name(encoding),
        rows.len()
    );
    let mut bytes = Vec::with_capacity(header.len() + rows.len() * ROW_BYTES);
    bytes.extend_from_slice(header.as_bytes());
    for row in rows {
        if encoding == CloudEncoding::Ascii {
            bytes.extend_from_slice(dense_text_row(row).as_bytes());
            continue;
        }
        row.point.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        bytes.extend_from_slice(&row.colour);
        row.pixels.iter().chain([&row.sigma]).for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        bytes.push(row.extrapolated.into());
    }
    bytes
}

fn dense_text_row(DenseRow { point, colour: [red, green, blue], pixels, sigma, extrapolated }: &DenseRow) -> String {
    let [x, y, z] = point;
    let mut row = format!("{x:.4} {y:.4} {z:.4} {red} {green} {blue}");
    // Writing to a String does not fail.
    pixels.iter().chain([sigma]).for_each(|value| _ = write!(row, " {value:.4}"));
    _ = writeln!(row, " {}", u8::from(*extrapolated));
    row
}

/// The name of the encoding in a header.
const fn name(encoding: CloudEncoding) -> &'static str {
    match encoding {
        CloudEncoding::Binary => "binary_little_endian",
        CloudEncoding::Ascii => "ascii",
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use vergence_vision::{Angle, CloudPoint, Length, Pixel, PixelPair, Point};

    use super::*;

    fn body(file: &[u8]) -> &[u8] {
        let mark = b"end_header\n";
        let at = file.windows(mark.len()).position(|window| window == mark).expect("a header");
        &file[at + mark.len()..]
    }

    #[test]
    fn both_encodings_hold_the_same_numbers() {
        let own = Matrix3::new(1.0, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 4.0);
        let point = CloudPoint {
            pair_index: 0,
            pixels: PixelPair { left: Pixel { u: 10.5, v: 20.25 }, right: Pixel { u: 30.0, v: 40.0 } },
            point: Point::from_mm(Vector3::new(1.5, -2.0, 350.0)),
            sigma_range: Length::from_mm(0.75),
            covariance: own * 3.0,
            own_covariance: own,
            residual: Angle::from_rad(0.0),
            residual_sigma: Angle::from_rad(0.0),
            extrapolated: true,
        };
        let points = [ColouredPoint { point, colour: [1, 2, 3], score: 0.5, track: Some(70_000) }];
        let text = String::from_utf8(ply(&points, CloudEncoding::Ascii)).expect("text");
        assert!(text.starts_with("ply\nformat ascii 1.0\n") && text.contains("element vertex 1\n"));
        let numbers: Vec<f64> = String::from_utf8_lossy(body(text.as_bytes()))
            .split_whitespace()
            .map(|n| n.parse().expect("a number"))
            .collect();
        let file = ply(&points, CloudEncoding::Binary);
        let bytes = body(&file);
        let double = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight"));
        let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")));
        let mut read: Vec<f64> = (0..3).map(|n| double(8 * n)).collect();
        read.extend(bytes[24..27].iter().map(|&colour| f64::from(colour)));
        read.extend((0..5).map(|n| double(27 + 8 * n)));
        read.extend((0..13).map(|n| float(67 + 4 * n)));
        let [flag, track @ ..] = &bytes[67 + 4 * 13..] else { panic!("a flag") };
        read.extend([f64::from(*flag), f64::from(i32::from_le_bytes(track.try_into().expect("four")))]);
        assert_eq!((bytes.len(), read.len()), (67 + 4 * 13 + 5, numbers.len()));
        for (one, other) in read.iter().zip(&numbers) {
            assert!((one - other).abs() <= 1e-4 * other.abs().max(1.0), "{one} is not {other}");
        }
        assert_eq!((numbers[12], numbers[18], numbers[24]), (3.0, 1.0, 1.0), "in all, of its own pixels, extrapolated");
        assert!((numbers[25] - 70_000.0).abs() < 0.5, "its track");
    }
}
