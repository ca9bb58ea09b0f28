//! Triangulation of matched pixels to a cloud of points with their uncertainty; [`Gates`] decide which matches become points.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use crate::covariance::range_sigma;
use crate::epipolar::ray_to_plane;
use crate::triangulation::{Triangulated, require};
use crate::uncertainty::{PointUncertainty, ResidualUncertainty};
use crate::{Angle, DropReason, Gates, Left, Length, MatchSigma, PixelPair, Point, Right, StereoPair};

/// A triangulated point with its match and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// Index of its match in the input.
    pub pair_index: usize,
    /// The match from which the point was triangulated.
    pub pixels: PixelPair,
    /// The point in the left frame.
    pub point: Point<Left>,
    /// Standard deviation of its distance from the left optical centre.
    pub sigma_range: Length,
    /// Its covariance in mm², in the left frame, from its pixels and from the shared parameters.
    pub covariance: Matrix3<f64>,
    /// The part of that from its own pixels alone; points of a pair share the errors behind the rest.
    pub own_covariance: Matrix3<f64>,
    /// The angle of one ray to the epipolar plane of the other, with the sign of [`crate::dihedral`].
    pub residual: Angle,
    /// Standard deviation of that angle.
    pub residual_sigma: Angle,
    /// Whether one of its rays lies where its lens was not measured, and is extrapolated.
    pub extrapolated: bool,
}

/// The points of one stereo pair, and the number of matches dropped for each reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points, in the order of their matches.
    pub points: Vec<CloudPoint>,
    /// Counts of dropped matches, for the reasons that occurred. With the points they add up to the number of matches.
    pub dropped: BTreeMap<DropReason, usize>,
}

/// Triangulates the matches `pairs` of the stereo pair `rig`, and keeps the points that pass `gates`.
///
/// Points and dropped matches add up to the number of matches.
#[must_use]
pub fn cloud(pairs: &[PixelPair], rig: &StereoPair<'_>, gates: &Gates) -> Cloud {
    collect(pairs.iter().map(|pixels| cloud_point(pixels, gates.pixel_sigma, rig, gates)))
}

/// Triangulates matches that each carry their own standard deviations in pixels, instead of [`Gates::pixel_sigma`]: one
/// number, or [`MatchSigma`].
///
/// Otherwise the same as [`cloud()`].
#[must_use]
pub fn cloud_of_each<S: Copy + Into<MatchSigma>>(
    pairs: &[(PixelPair, S)],
    rig: &StereoPair<'_>,
    gates: &Gates,
) -> Cloud {
    collect(pairs.iter().map(|(pixels, sigma)| cloud_point(pixels, *sigma, rig, gates)))
}

fn collect(fates: impl Iterator<Item = Result<CloudPoint, DropReason>>) -> Cloud {
    let mut cloud = Cloud::default();
    for (pair_index, fate) in fates.enumerate() {
        match fate {
            Ok(point) => cloud.points.push(CloudPoint { pair_index, ..point }),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    cloud
}

/// Triangulates one match whose pixels have the standard deviations `sigma`, instead of [`Gates::pixel_sigma`]; the
/// `pair_index` of the point is 0.
///
/// # Errors
/// The reason of the first gate that the match fails.
pub fn cloud_point(
    pixels: &PixelPair,
    sigma: impl Into<MatchSigma>,
    rig: &StereoPair<'_>,
    gates: &Gates,
) -> Result<CloudPoint, DropReason> {
    let sigma = sigma.into();
    let left = rig.left.unproject::<Left>(pixels.left).map_err(|_| DropReason::OutsideLeftField)?;
    let in_right = rig.right.unproject::<Right>(pixels.right).map_err(|_| DropReason::OutsideRightField)?;
    let (between, _) = rig.at_origins(&left, &in_right);
    let (right, right_centre) = (between.left_from_right * in_right, between.left_from_right.origin());

    let residual = ray_to_plane(&left, &right, &right_centre).ok_or(DropReason::OnBaseline)?;
    let residual_sigma = ResidualUncertainty::of(&left, &in_right, rig, sigma)
        .map(|uncertainty| uncertainty.sigma(&gates.shared))
        .ok_or(DropReason::Uncertain)?;
    let allowed = Angle::from_rad(residual_sigma.rad().hypot(gates.epipolar_allowance.rad()));
    require(residual.abs() <= allowed * gates.epipolar_sigmas, DropReason::Epipolar)?;

    let Triangulated { point, left_range, parallax, .. } = gates.kernel.of_rays(pixels, &left, &in_right, rig)?;
    require(parallax >= gates.min_parallax, DropReason::Parallax)?;
    require(gates.max_range.is_none_or(|limit| left_range <= limit), DropReason::TooFar)?;

    let uncertainty = PointUncertainty::by(&gates.kernel, &point, rig, sigma).ok_or(DropReason::Uncertain)?;
    let own_sigma = range_sigma(&uncertainty.from_pixels, &point).ok_or(DropReason::Uncertain)?;
    require(own_sigma.mm() <= gates.max_relative_sigma * left_range.mm(), DropReason::Uncertain)?;
    let covariance = uncertainty.covariance(&gates.shared);
    let sigma_range = range_sigma(&covariance, &point).ok_or(DropReason::Uncertain)?;
    Ok(CloudPoint {
        pair_index: 0,
        pixels: *pixels,
        point,
        sigma_range,
        covariance,
        own_covariance: uncertainty.from_pixels,
        residual,
        residual_sigma,
        extrapolated: !(rig.left.is_measured(&left) && rig.right.is_measured(&in_right)),
    })
}
