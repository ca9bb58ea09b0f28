//! Dense clouds as PLY (G. Turk, Stanford, 1994), in its binary form: a million points in text would take a hundred
//! megabytes.

use super::ply::COLUMNS_COMMENT;

/// A row of the cloud: what [`super::ply`] writes, in the same columns.
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
