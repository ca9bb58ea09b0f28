//! Clouds as PLY (G. Turk, Stanford, 1994): in ASCII, which any tool reads, for the thousands of points of a sparse cloud; in
//! its binary form for dense clouds, because a million points in text would take a hundred megabytes.

use std::fmt::Write;

use vergence_pipeline::ColouredPoint;

/// The line of every header that explains unit and frame.
const COLUMNS_COMMENT: &str = "comment millimetres in the left camera's frame: x right, y down, z forward\n";

/// The points in the left camera's frame, in millimetres, with colour, pixels in both images, sigma of the range, and the
/// matcher's score.
#[must_use]
pub fn ply(points: &[ColouredPoint]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\n{COLUMNS_COMMENT}\
         element vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property double u_left\nproperty double v_left\nproperty double u_right\nproperty double v_right\n\
         property double sigma_range\nproperty float score\nend_header\n",
        points.len()
    );
    for ColouredPoint { point, colour: [red, green, blue], score } in points {
        let p = point.point.mm();
        let (left, right) = (point.pixels.left, point.pixels.right);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:.4} {:.4} {:.4} {red} {green} {blue} {:.4} {:.4} {:.4} {:.4} {:.4} {score:.4}",
            p.x,
            p.y,
            p.z,
            left.u,
            left.v,
            right.u,
            right.v,
            point.sigma_range.mm()
        );
    }
    text
}

/// A row of a dense cloud: what [`ply`] writes, in the same columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseRow {
    /// Millimetres in the left camera's frame.
    pub point: [f32; 3],
    /// sRGB.
    pub colour: [u8; 3],
    /// u and v in the left and the right image.
    pub pixels: [f32; 4],
    /// Of the range, in millimetres.
    pub sigma: f32,
}

/// Rows with the columns of the sparse cloud, little-endian, in single precision.
#[must_use]
pub fn dense_ply(rows: &[DenseRow]) -> Vec<u8> {
    const ROW_BYTES: usize = 35;
    let header = format!(
        "ply\nformat binary_little_endian 1.0\n{COLUMNS_COMMENT}\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float u_left\nproperty float v_left\nproperty float u_right\nproperty float v_right\n\
         property float sigma_range\nend_header\n",
        rows.len()
    );
    let mut bytes = Vec::with_capacity(header.len() + rows.len() * ROW_BYTES);
    bytes.extend_from_slice(header.as_bytes());
    for row in rows {
        row.point.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        bytes.extend_from_slice(&row.colour);
        row.pixels.iter().chain([&row.sigma]).for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    }
    bytes
}
