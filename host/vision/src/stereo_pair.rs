//! Stereo pairs, matches between their images, and the reasons why a match makes no point.

use std::fmt;

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

/// Why a match makes no point: the first gate that it fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DropReason {
    /// The left pixel is outside the left lens's valid cone.
    OutsideLeftField,
    /// The right pixel is outside the right lens's valid cone.
    OutsideRightField,
    /// The rays are too far from one epipolar plane.
    Epipolar,
    /// The point is on the line through both centres, where its range is undetermined.
    OnBaseline,
    /// The rays meet behind a camera.
    Diverging,
    /// The rays are parallel or nearly so.
    Parallax,
    /// The point is beyond the largest range.
    TooFar,
    /// The range is too uncertain from the noise of its own pixels alone.
    Uncertain,
    /// The method of triangulation finds no point: it is outside the rectified view, or no minimum is near.
    NoPoint,
}

impl DropReason {
    /// The stable name in snake case, for reports and files.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::OutsideLeftField => "outside_left_field",
            Self::OutsideRightField => "outside_right_field",
            Self::Epipolar => "epipolar",
            Self::OnBaseline => "on_baseline",
            Self::Diverging => "diverging",
            Self::Parallax => "parallax",
            Self::TooFar => "too_far",
            Self::Uncertain => "uncertain",
            Self::NoPoint => "no_point",
        }
    }
}

impl fmt::Display for DropReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}
