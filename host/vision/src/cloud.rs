//! From matched pixels to points with their uncertainty, and a reason for every match that made none.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Matrix3;

use crate::covariance::{covariance, range_sigma};
use crate::epipolar::ray_to_plane;
use crate::triangulation::{Rejection, Triangulated, pseudo_intersection};
use crate::{Angle, KannalaBrandt, Left, Length, Pixel, Point, Right, Transform, UnitRay};

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

/// What a pair must satisfy to become a point. A limit that is not a number lets nothing pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gates {
    /// Largest angle of one ray to the epipolar plane of the other.
    pub epipolar: Angle,
    /// Smallest angle that the baseline spans as seen from the point.
    pub min_parallax: Angle,
    /// Largest distance from the left optical centre, if there is a limit.
    pub max_range: Option<Length>,
    /// Standard deviation of a matched position in pixels, in each direction and each image.
    pub pixel_sigma: f64,
    /// Largest standard deviation of the range, as a part of the range.
    pub max_relative_sigma: f64,
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
    /// The range is too uncertain.
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
    /// Its covariance in mm², in the left frame.
    pub covariance: Matrix3<f64>,
    /// The angle of one ray to the epipolar plane of the other; sign as [`crate::dihedral`].
    pub residual: Angle,
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
    let mut cloud = Cloud::default();
    for (pair_index, pixels) in pairs.iter().enumerate() {
        match cloud_point(pair_index, *pixels, rig, gates) {
            Ok(point) => cloud.points.push(point),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    cloud
}

fn cloud_point(pair_index: usize, pixels: PixelPair, rig: &StereoPair<'_>, gates: &Gates) -> Result<CloudPoint, Drop> {
    let left = rig.left.unproject::<Left>(pixels.left).map_err(|_| Drop::OutsideLeftField)?;
    let in_right = rig.right.unproject::<Right>(pixels.right).map_err(|_| Drop::OutsideRightField)?;
    let (right, right_centre) = (rig.left_from_right * in_right, rig.left_from_right.origin());

    let residual = ray_to_plane(&left, &right, &right_centre).ok_or(Drop::OnBaseline)?;
    require(residual.abs() <= gates.epipolar, Drop::Epipolar)?;

    let Triangulated { point, left_range, parallax, .. } = pseudo_intersection(&left, &right, &right_centre)?;
    require(parallax >= gates.min_parallax, Drop::Parallax)?;
    require(gates.max_range.is_none_or(|limit| left_range <= limit), Drop::TooFar)?;

    let sigma = ray_sigma(rig, &left, &in_right, gates.pixel_sigma);
    let covariance = covariance(&point, &right_centre, sigma).ok_or(Drop::Uncertain)?;
    let sigma_range = range_sigma(&covariance, &point).ok_or(Drop::Uncertain)?;
    require(sigma_range.mm() <= gates.max_relative_sigma * left_range.mm(), Drop::Uncertain)?;
    Ok(CloudPoint { pair_index, pixels, point, sigma_range, covariance, residual })
}

/// The angular standard deviation of both rays: that of the camera with fewer pixels per radian along the radius where
/// it sees the point. Across it most fisheyes resolve more.
fn ray_sigma(rig: &StereoPair<'_>, left: &UnitRay<Left>, right: &UnitRay<Right>, pixel_sigma: f64) -> Angle {
    let left = rig.left.pixels_per_radian(left.angle_to_axis());
    let right = rig.right.pixels_per_radian(right.angle_to_axis());
    Angle::from_rad(pixel_sigma / left.min(right))
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
