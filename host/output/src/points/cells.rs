//! The columns of a cloud in formats whose numbers have single precision.

use vergence_pipeline::ColouredPoint;

use super::columns::{COVARIANCE_COLUMNS, DenseRow, covariances, pixels_and_sigma, track_number};

const POINT_COLUMNS: [&str; 3] = ["x", "y", "z"];
pub(super) const COLOUR_COLUMN: &str = "rgb";
const PIXEL_COLUMNS: [&str; 5] = ["u_left", "v_left", "u_right", "v_right", "sigma_range"];
const SCORE_COLUMN: &str = "score";
pub(super) const EXTRAPOLATED_COLUMN: &str = "extrapolated";
pub(super) const TRACK_COLUMN: &str = "track";

/// A value of a row.
#[derive(Clone, Copy)]
pub(super) enum Cell {
    Number(f32),
    /// One number, 0x00RRGGBB.
    Colour([u8; 3]),
    Flag(bool),
    Track(i32),
}

impl Cell {
    /// Appends the value, little-endian.
    pub fn binary(self, bytes: &mut Vec<u8>) {
        match self {
            Self::Number(value) => bytes.extend_from_slice(&value.to_le_bytes()),
            Self::Colour(colour) => bytes.extend_from_slice(&packed(colour).to_le_bytes()),
            Self::Flag(flag) => bytes.push(flag.into()),
            Self::Track(track) => bytes.extend_from_slice(&track.to_le_bytes()),
        }
    }

    pub fn text(self) -> String {
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

/// The columns of a sparse cloud, those of a PLY file, but the colour as one number.
pub(super) fn sparse_columns() -> Vec<&'static str> {
    [
        &POINT_COLUMNS[..],
        &[COLOUR_COLUMN],
        &PIXEL_COLUMNS,
        &[SCORE_COLUMN],
        &COVARIANCE_COLUMNS,
        &[EXTRAPOLATED_COLUMN, TRACK_COLUMN],
    ]
    .concat()
}

/// The values of [`sparse_columns`].
pub(super) fn sparse_cells(
    ColouredPoint { point, colour, score, track }: &ColouredPoint,
) -> impl Iterator<Item = Cell> + use<> {
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

/// Those of the columns that a dense cloud has.
pub(super) fn dense_columns() -> Vec<&'static str> {
    [&POINT_COLUMNS[..], &[COLOUR_COLUMN], &PIXEL_COLUMNS, &[EXTRAPOLATED_COLUMN]].concat()
}

/// The values of [`dense_columns`].
pub(super) fn dense_cells(
    DenseRow { point, colour, pixels, sigma, extrapolated }: &DenseRow,
) -> impl Iterator<Item = Cell> + use<> {
    point
        .map(Cell::Number)
        .into_iter()
        .chain([Cell::Colour(*colour)])
        .chain(pixels.map(Cell::Number))
        .chain([Cell::Number(*sigma), Cell::Flag(*extrapolated)])
}
