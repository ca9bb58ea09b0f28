//! What the columns of a cloud hold, whatever the format of its file.

use vergence_vision::CloudPoint;

use super::table::upper_triangle;

/// Unit and frame of the coordinates.
pub(super) const ABOUT_FRAME: &str = "millimetres in the left camera's frame: x right, y down, z forward";
/// What a score means.
pub(super) const ABOUT_SCORE: &str =
    "score: probability that the match is right, its range off by at most three sigma_range";
/// What the covariances mean.
pub(super) const ABOUT_COVARIANCES: &str =
    "cov in mm^2: in all; own: of the point's own pixels, the rest is shared by all points";

/// Names of the twelve columns of covariance in mm²: in all, and of the point's own pixels.
pub(super) const COVARIANCE_COLUMNS: [&str; 12] = [
    "cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz", "own_xx", "own_xy", "own_xz", "own_yy", "own_yz",
    "own_zz",
];

/// The values of [`COVARIANCE_COLUMNS`].
pub(super) fn covariances(point: &CloudPoint) -> [f64; 12] {
    let [all, own] =
        [&point.covariance, &point.own_covariance].map(|covariance| upper_triangle(|place| covariance[place]));
    std::array::from_fn(|index| if index < 6 { all[index] } else { own[index - 6] })
}

/// u and v in the left and the right image, and the sigma of the range in millimetres.
pub(super) fn pixels_and_sigma(point: &CloudPoint) -> [f64; 5] {
    let (left, right) = (point.pixels.left, point.pixels.right);
    [left.u, left.v, right.u, right.v, point.sigma_range.mm()]
}

/// The number of a track in 31 bits, -1 without one. After 2^31 tracks the numbers begin anew.
pub(super) fn track_number(track: Option<u64>) -> i32 {
    track.map_or(-1, |track| (track & 0x7fff_ffff) as i32)
}

/// A row of a dense cloud: the first columns of a sparse one, and whether a lens is extrapolated.
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
    /// Whether a lens is extrapolated there.
    pub extrapolated: bool,
}
