//! Keypoints of the left view with their partners in the right one, and what makes a partner be given up.

use rayon::prelude::*;
use vergence_vision::{Angle, Left, Right};

use crate::consensus::{Consensus, Sighting};
use crate::corners::Keypoint;
use crate::distinct::Surroundings;
use crate::epipolar_band::EpipolarBand;
use crate::matcher::{Drop, Match, Matches};
use crate::neighbours::{self, Placed};
use crate::plane::Pyramid;
use crate::refine;
use crate::shared_views::SharedViews;
use crate::{Grid, View, ViewPixel};

/// A left keypoint's partner in the right view.
#[derive(Clone, Copy)]
pub(crate) struct Link {
    pub right: ViewPixel,
    pub score: f64,
    /// Standard deviation of each coordinate of `right` as the place of the left keypoint, in pixels of the view.
    pub sigma: f64,
}

/// One entry for every left keypoint.
pub(crate) type Links = Vec<Result<Link, Drop>>;

/// What is registered and compared: the smoothed views, and the keypoints of the left one.
#[derive(Clone, Copy)]
pub(crate) struct Compared<'a> {
    pub left: &'a Pyramid,
    pub right: &'a Pyramid,
    pub keypoints: &'a [Keypoint],
}

/// How far off the epipolar curve a registered match may be, in pixels, where the pose is exact.
const REGISTERED_TOLERANCE: f64 = 1.2;
/// Standard deviation of a registered match in pixels of the view. Measured on rendered pairs: see docs/measured.md.
pub(crate) const REGISTERED_SIGMA: f64 = 0.3;
/// A match that could not be registered is believed from this likeness on.
const LEAST_UNREGISTERED_SCORE: f64 = 0.5;
/// How many standard deviations off the epipolar curve a match may be, beyond [`REGISTERED_TOLERANCE`].
const EPIPOLAR_SIGMAS: f64 = 3.0;

/// Replaces every link's right position by the registered one, and drops what the pose does not allow there. What cannot be
/// registered is dropped too, or kept where it is for certain only to `unregistered` pixels.
pub(crate) fn register(links: &mut Links, compared: &Compared<'_>, band: &EpipolarBand, unregistered: Option<f64>) {
    links.par_iter_mut().zip(compared.keypoints).for_each(|(link, keypoint)| {
        *link = link.and_then(|start| {
            match (registered(compared, keypoint.at, start.right, keypoint.level, band), unregistered) {
                (Err(reason), Some(sigma)) if stays(reason, &start) => Ok(Link { sigma, ..start }),
                (outcome, _) => outcome,
            }
        });
    });
}

/// Where the right view shows what the left one shows at `left`, sought from `start` on, `level` first.
///
/// # Errors
/// Why it is not to be trusted.
pub(crate) fn registered(
    compared: &Compared<'_>,
    left: ViewPixel,
    start: ViewPixel,
    level: usize,
    band: &EpipolarBand,
) -> Result<Link, Drop> {
    let found = refine::register([compared.left, compared.right], left, start, level)?;
    if !band.allows(left, found.right, REGISTERED_TOLERANCE) {
        return Err(Drop::Epipolar);
    }
    Ok(Link { right: found.right, score: found.correlation, sigma: REGISTERED_SIGMA })
}

/// Whether a match that could not be registered is still believed: on rendered pairs nine in ten of these are right, but
/// little more than half of those that registration leaves or does not settle on.
fn stays(reason: Drop, link: &Link) -> bool {
    !matches!(reason, Drop::NotRefined | Drop::Epipolar) && link.score >= LEAST_UNREGISTERED_SCORE
}

/// Drops what is off the epipolar planes of the pose that the links agree on.
pub(crate) fn agree_on_pose(links: &mut Links, keypoints: &[Keypoint], grid: &Grid, pose_sigma: Angle) {
    let linked = links.iter().zip(keypoints);
    let sightings: Vec<_> =
        linked.filter_map(|(link, keypoint)| sighting(grid, keypoint, link.as_ref().ok()?)).collect();
    let consensus = Consensus::of(&sightings, pose_sigma);
    let pixel = Angle::from_rad(1.0 / grid.pixels_per_radian());
    for (link, keypoint) in links.iter_mut().zip(keypoints) {
        *link = link.and_then(|link| {
            let off = sighting(grid, keypoint, &link).and_then(|sighting| consensus.off_plane(&sighting));
            let (off, sigma) = off.ok_or(Drop::Epipolar)?;
            let tolerance = pixel * (EPIPOLAR_SIGMAS * link.sigma).max(REGISTERED_TOLERANCE);
            if off > tolerance + sigma * EpipolarBand::SIGMAS { Err(Drop::Epipolar) } else { Ok(link) }
        });
    }
}

/// The bearings of a link.
pub(crate) fn sighting(grid: &Grid, keypoint: &Keypoint, link: &Link) -> Option<Sighting> {
    let sigma = Angle::from_rad(link.sigma / grid.pixels_per_radian());
    Some(Sighting { left: grid.bearing(keypoint.at)?, right: grid.bearing(link.right)?, sigma })
}

/// What both views show along their rows; `None` where they are too small to tell.
pub(crate) struct Rows<'a>(Option<[Surroundings<'a>; 2]>);

impl<'a> Rows<'a> {
    pub(crate) fn of(compared: &Compared<'a>) -> Self {
        Self(Surroundings::of(compared.left).zip(Surroundings::of(compared.right)).map(<[_; 2]>::from))
    }

    /// Drops what a view shows again where the partner might lie.
    pub(crate) fn drop_repeated(&self, links: &mut Links, keypoints: &[Keypoint], band: &EpipolarBand) {
        let Some([in_left, in_right]) = &self.0 else { return };
        links.par_iter_mut().zip(keypoints).for_each(|(link, keypoint)| {
            *link = link.and_then(|link| {
                let (l, r) = (keypoint.at, link.right);
                let farthest = band.largest_disparity(l.x);
                let distinct =
                    in_right.is_distinct(r, l.x - farthest, l.x) && in_left.is_distinct(l, r.x, r.x + farthest);
                if distinct { Ok(link) } else { Err(Drop::Repeated) }
            });
        });
    }
}

/// Drops what no neighbour supports, then what is there twice.
pub(crate) fn thin(links: &mut Links, keypoints: &[Keypoint]) {
    keep(links, keypoints, neighbours::supported, Drop::Isolated);
    keep(links, keypoints, |placed| neighbours::duplicated(placed).iter().map(|d| !d).collect(), Drop::Duplicate);
}

/// Drops the links that `judge` rejects.
fn keep(links: &mut Links, keypoints: &[Keypoint], judge: impl Fn(&[Placed]) -> Vec<bool>, reason: Drop) {
    let place = |(link, keypoint): (&Result<Link, Drop>, &Keypoint)| {
        let link = link.as_ref().ok()?;
        let disparity = keypoint.at.x - link.right.x;
        Some(Placed { left: keypoint.at, disparity, score: link.score, sigma: link.sigma })
    };
    let placed: Vec<Placed> = links.iter().zip(keypoints).filter_map(place).collect();
    let verdicts = judge(&placed);
    for (link, kept) in links.iter_mut().filter(|link| link.is_ok()).zip(verdicts) {
        if !kept {
            *link = Err(reason);
        }
    }
}

/// The links as matches in pixels of the original images.
pub(crate) fn in_originals(
    links: &Links,
    views: &SharedViews<'_>,
    keypoints: &[Keypoint],
    right_keypoints: usize,
) -> Matches {
    let mut matches = Matches { left_keypoints: keypoints.len(), right_keypoints, ..Matches::default() };
    for (keypoint, link) in keypoints.iter().zip(links) {
        match link.and_then(|link| original(&views.left, &views.right, keypoint, &link)) {
            Ok(found) => matches.pairs.push(found),
            Err(reason) => *matches.dropped.entry(reason).or_default() += 1,
        }
    }
    matches
}

fn original(left_view: &View<Left>, right_view: &View<Right>, keypoint: &Keypoint, link: &Link) -> Result<Match, Drop> {
    let left = left_view.original(keypoint.at).map_err(|_| Drop::NotRefined)?;
    let right = right_view.original(link.right).map_err(|_| Drop::NotRefined)?;
    // The link's error is that of the right position alone. Shared by both it is smaller in each.
    let sigma = link.sigma * right_view.shrinking(right) * std::f64::consts::FRAC_1_SQRT_2;
    Ok(Match { left, right, sigma, score: link.score as f32 })
}
