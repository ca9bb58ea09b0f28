//! The gates that a match must pass to become a point, and the reasons why it becomes none.

use std::fmt;

use crate::triangulation::Kernel;
use crate::{Angle, Length, SharedCovariance};

/// Settings of triangulation: standard deviations, the limits that a match must satisfy, and the method.
///
/// A limit that is not a number drops every match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gates {
    /// Largest angle of one ray to the epipolar plane of the other, in standard deviations of that angle, which come
    /// from pixel noise and from the shared parameters.
    pub epipolar_sigmas: f64,
    /// Standard deviation of that angle by what [`Self::shared`] does not know, added for the gate alone.
    pub epipolar_allowance: Angle,
    /// Smallest parallax: the angle that the baseline spans as seen from the point.
    pub min_parallax: Angle,
    /// Largest distance from the left optical centre; `None` for no limit.
    pub max_range: Option<Length>,
    /// Standard deviation of a matched position in pixels, in each coordinate of each image.
    pub pixel_sigma: f64,
    /// Largest standard deviation of the range from the noise of its own two pixels, as a fraction of the range. The
    /// uncertainty of lenses and pose is reported but not limited here: it bends the cloud as a whole.
    pub max_relative_sigma: f64,
    /// Covariance of lenses and pose, which all points share.
    pub shared: SharedCovariance,
    /// The method of triangulation.
    pub kernel: Kernel,
}

impl Default for Gates {
    /// Three standard deviations at the epipolar gate, lenses and pose known exactly, matches good to 0.2 pixels, and
    /// ranges with a standard deviation up to a twentieth.
    fn default() -> Self {
        Self {
            epipolar_sigmas: 3.0,
            epipolar_allowance: Angle::from_rad(0.0),
            min_parallax: Angle::from_rad(0.0),
            max_range: None,
            pixel_sigma: 0.2,
            max_relative_sigma: 0.05,
            shared: SharedCovariance::exact(),
            kernel: Kernel::PseudoIntersection,
        }
    }
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
