//! From matched pixels to points with their uncertainty, and a reason for every match that made none.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Matrix3;

use crate::covariance::range_sigma;
use crate::epipolar::ray_to_plane;
use crate::triangulation::{Kernel, Rejection, Triangulated};
use crate::uncertainty::{PointUncertainty, ResidualUncertainty, SharedCovariance};
use crate::{Angle, KannalaBrandt, Left, Length, Pixel, Point, Right, Transform};

/// The same thing seen in both images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelPair {
    /// Where the left camera sees it.
    pub left: Pixel,
    /// Where the right camera sees it.
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

/// What is uncertain about a pair, what it must satisfy to become a point, and how it becomes one. A limit that is not a
/// number lets nothing pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gates {
    /// Largest angle of one ray to the epipolar plane of the other, in standard deviations of that angle: those of the
    /// pixels and of what is shared.
    pub epipolar_sigmas: f64,
    /// Smallest angle that the baseline spans as seen from the point.
    pub min_parallax: Angle,
    /// Largest distance from the left optical centre, if there is a limit.
    pub max_range: Option<Length>,
    /// Standard deviation of a matched position in pixels, in each direction and each image.
    pub pixel_sigma: f64,
    /// Largest standard deviation of the range from the noise of its own two pixels, as a part of the range. What all points
    /// share is stated and not gated: it bends the cloud as a whole.
    pub max_relative_sigma: f64,
    /// How well lenses and pose are known.
    pub shared: SharedCovariance,
    /// The method of triangulation.
    pub kernel: Kernel,
}

impl Default for Gates {
    /// Three standard deviations with lenses and pose known exactly and matches good to a fifth of a pixel; every range that
    /// is known to a twentieth.
    fn default() -> Self {
        Self {
            epipolar_sigmas: 3.0,
            min_parallax: Angle::from_rad(0.0),
            max_range: None,
            pixel_sigma: 0.2,
            max_relative_sigma: 0.05,
            shared: SharedCovariance::exact(),
            kernel: Kernel::PseudoIntersection,
        }
    }
}

/// Why a pair made no point: the first gate that it failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Drop {
    /// The left pixel is outside the left lens's valid cone.
    OutsideLeftField,
    /// The right pixel is outside the right lens's valid cone.
    OutsideRightField,
    /// The rays are too far from one epipolar plane.
    Epipolar,
    /// The point is on the line through both centres, where there is no range to find.
    OnBaseline,
    /// The rays meet behind a camera.
    Diverging,
    /// The rays are parallel or nearly so.
    Parallax,
    /// The point is beyond the largest range.
    TooFar,
    /// The range is too uncertain already by the noise of its pixels.
    Uncertain,
    /// The method of triangulation finds no point here: the rectified view does not hold it, or no minimum is near.
    NoPoint,
}

/// A point, where it came from and how good it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// Which of the pairs it is.
    pub pair_index: usize,
    /// That pair.
    pub pixels: PixelPair,
    /// The point in the left frame.
    pub point: Point<Left>,
    /// Standard deviation of its distance from the left optical centre.
    pub sigma_range: Length,
    /// Its covariance in mm², in the left frame: from its pixels and from what all points of the pair share.
    pub covariance: Matrix3<f64>,
    /// The angle of one ray to the epipolar plane of the other; sign as [`crate::dihedral`].
    pub residual: Angle,
    /// Standard deviation of that angle.
    pub residual_sigma: Angle,
}

/// The points of one stereo pair, and how many matches were dropped for which reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// In the order of the pairs.
    pub points: Vec<CloudPoint>,
    /// Only reasons that occurred. With the points they account for every pair.
    pub dropped: BTreeMap<Drop, usize>,
}

/// The points of `pairs` seen by `rig`, as far as they pass `gates`. The points and the dropped pairs add up to the
/// number of pairs.
#[must_use]
pub fn cloud(pairs: &[PixelPair], rig: &StereoPair<'_>, gates: &Gates) -> Cloud {
    collect(pairs.iter().map(|pixels| cloud_point(pixels, rig, gates)))
}

/// The same where the noise of every pair is its own: its standard deviation in pixels stands with it, instead of that of
/// `gates`.
#[must_use]
pub fn cloud_of_each(pairs: &[(PixelPair, f64)], rig: &StereoPair<'_>, gates: &Gates) -> Cloud {
    let of = |(pixels, pixel_sigma): &(PixelPair, f64)| {
        cloud_point(pixels, rig, &Gates { pixel_sigma: *pixel_sigma, ..*gates })
    };
    collect(pairs.iter().map(of))
}

fn collect(fates: impl Iterator<Item = Result<CloudPoint, Drop>>) -> Cloud {
    let mut cloud = Cloud::default();
    for (pair_index, fate) in fates.enumerate() {
        match fate {
            Ok(point) => cloud.points.push(CloudPoint { pair_index, ..point }),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    cloud
}

/// The point of one pair, numbered 0, as far as it passes `gates`.
///
/// # Errors
/// The first gate that it failed.
pub fn cloud_point(pixels: &PixelPair, rig: &StereoPair<'_>, gates: &Gates) -> Result<CloudPoint, Drop> {
    let left = rig.left.unproject::<Left>(pixels.left).map_err(|_| Drop::OutsideLeftField)?;
    let in_right = rig.right.unproject::<Right>(pixels.right).map_err(|_| Drop::OutsideRightField)?;
    let (right, right_centre) = (rig.left_from_right * in_right, rig.left_from_right.origin());

    let residual = ray_to_plane(&left, &right, &right_centre).ok_or(Drop::OnBaseline)?;
    let residual_sigma = ResidualUncertainty::of(&left, &in_right, rig, gates.pixel_sigma)
        .map(|uncertainty| uncertainty.sigma(&gates.shared))
        .ok_or(Drop::Uncertain)?;
    require(residual.abs() <= residual_sigma * gates.epipolar_sigmas, Drop::Epipolar)?;

    let Triangulated { point, left_range, parallax, .. } = gates.kernel.of_rays(pixels, &left, &in_right, rig)?;
    require(parallax >= gates.min_parallax, Drop::Parallax)?;
    require(gates.max_range.is_none_or(|limit| left_range <= limit), Drop::TooFar)?;

    let uncertainty = PointUncertainty::by(&gates.kernel, &point, rig, gates.pixel_sigma).ok_or(Drop::Uncertain)?;
    let own_sigma = range_sigma(&uncertainty.from_pixels, &point).ok_or(Drop::Uncertain)?;
    require(own_sigma.mm() <= gates.max_relative_sigma * left_range.mm(), Drop::Uncertain)?;
    let covariance = uncertainty.covariance(&gates.shared);
    let sigma_range = range_sigma(&covariance, &point).ok_or(Drop::Uncertain)?;
    Ok(CloudPoint { pair_index: 0, pixels: *pixels, point, sigma_range, covariance, residual, residual_sigma })
}

/// Stated as what must hold, so that a comparison with NaN drops the pair.
fn require(holds: bool, otherwise: Drop) -> Result<(), Drop> {
    if holds { Ok(()) } else { Err(otherwise) }
}

impl From<Rejection> for Drop {
    fn from(rejection: Rejection) -> Self {
        match rejection {
            Rejection::Parallel => Self::Parallax,
            Rejection::OnBaseline => Self::OnBaseline,
            Rejection::Diverging => Self::Diverging,
            Rejection::OutsideView | Rejection::NotConverged => Self::NoPoint,
        }
    }
}

impl Drop {
    /// A stable name in snake case, for reports and files.
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

impl fmt::Display for Drop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}
