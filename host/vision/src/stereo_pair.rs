//! Stereo pairs, and matches between their images.

use crate::{KannalaBrandt, Left, Pixel, Right, Transform};

/// A match: the pixels where both images show the same scene point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelPair {
    /// Pixel of the point in the left image.
    pub left: Pixel,
    /// Pixel of the point in the right image.
    pub right: Pixel,
}

/// Two cameras and their relative pose at one exposure.
#[derive(Clone, Copy, Debug)]
pub struct StereoPair<'a> {
    /// The left camera.
    pub left: &'a KannalaBrandt,
    /// The right camera.
    pub right: &'a KannalaBrandt,
    /// The pose of the right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
}
