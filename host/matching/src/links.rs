//! Links: the partners of the left keypoints in the right view, and the tests that drop them.

use std::ops::Range;

use rayon::prelude::*;
use vergence_vision::Angle;

use crate::consensus::{BearingPair, Consensus};
use crate::corners::Keypoint;
use crate::distinct::Surroundings;
use crate::epipolar_band::EpipolarBand;
use crate::match_errors::Evidence;
use crate::matcher::{Match, Matches, UnmatchedReason};
use crate::neighbours::{self, PlacedMatch};
use crate::plane::Pyramid;
use crate::refine::{self, Registered, Scratch, Unregistered};
use crate::shared_views::SharedViews;
use crate::{Grid, ViewPixel};

/// A left keypoint's partner in the right view.
#[derive(Clone, Copy)]
pub(crate) struct Link {
    pub right: ViewPixel,
    pub score: f64,
    /// Standard deviations of `right` as the place of the left keypoint, along the row and across it, in pixels of the
    /// view on the axis: a pixel across is shorter elsewhere, as its angle is.
    pub sigma: [f64; 2],
    /// What its registration showed; `None` without one.
    pub evidence: Option<Evidence>,
    /// Whether the registration is good to a small part of a pixel.
    pub registered: bool,
    /// How far the disparities of the windows to the left, to the right, above and below depart from the plane of its own, in pixels of the view;
    /// infinite where a window cannot be registered. `None` before they are measured.
    pub departures: Option<[f64; 4]>,
    /// Distance from the epipolar plane of the pose on which the matches agree, in standard deviations.
    pub off_plane: f64,
    /// Probability that the link is right.
    pub right_probability: f64,
    /// The track that it continues or begins.
    pub track: Option<u64>,
}

impl Link {
    /// A link whose right position is a keypoint.
    pub(crate) const fn of_keypoints(right: ViewPixel, score: f64, sigma: [f64; 2]) -> Self {
        Self {
            right,
            score,
            sigma,
            evidence: None,
            registered: false,
            departures: None,
            off_plane: 0.0,
            right_probability: score,
            track: None,
        }
    }
}

/// One entry for every left keypoint: its partner, or why it has none.
pub(crate) type Links = Vec<Result<Link, UnmatchedReason>>;

/// The input of registration: both smoothed views, and the keypoints of the left one.
#[derive(Clone, Copy)]
pub(crate) struct Compared<'a> {
    pub left: &'a Pyramid,
    pub right: &'a Pyramid,
    pub keypoints: &'a [Keypoint],
    /// Pixels of a view per pixel of an image.
    pub oversampling: f64,
}

/// Largest distance of a registered match from the epipolar curve of an exact pose, in pixels of the view.
const REGISTERED_TOLERANCE: f64 = 1.2;
/// Smallest score of a match that is kept without registration.
const LEAST_UNREGISTERED_SCORE: f64 = 0.5;
/// Largest distance of a match from the epipolar curve in standard deviations, where that exceeds
/// [`REGISTERED_TOLERANCE`].
const EPIPOLAR_SIGMAS: f64 = 3.0;

/// Replaces the right position of every link by the registered one, and drops links that the pose does not allow.
///
/// A link that cannot be registered is dropped, or with `keep_unregistered` kept if its score is high enough: where its registration ended, or
/// where it was.
pub(crate) fn register(links: &mut Links, compared: &Compared<'_>, band: &EpipolarBand, keep_unregistered: bool) {
    links.par_iter_mut().zip(compared.keypoints).for_each_init(Scratch::new, |scratch, (link, keypoint)| {
        let mut from = |start: &Link| registered(scratch, compared, (keypoint.at, keypoint.level), start.right, band);
        *link = link.and_then(|start| match from(&start) {
            Err(failed) if keep_unregistered => unregistered(&start, keypoint.at, &failed, compared, band),
            outcome => outcome.map_err(|failed| failed.reason),
        });
    });
}

/// Registers the right view around `start` to the left view at `left`, from `level` down to the finest.
///
/// # Errors
/// Why the result is not good to a small part of a pixel, with the result where there is one.
pub(crate) fn registered(
    scratch: &mut Scratch,
    compared: &Compared<'_>,
    (left, level): (ViewPixel, usize),
    start: ViewPixel,
    band: &EpipolarBand,
) -> Result<Link, Unregistered> {
    let found = refine::register(scratch, [compared.left, compared.right], left, start, level)?;
    in_band(&found, left, compared.oversampling, band)
}

/// The link of a registration, if its place is in the epipolar band.
///
/// # Errors
/// That it is not.
pub(crate) fn in_band(
    found: &Registered,
    left: ViewPixel,
    oversampling: f64,
    band: &EpipolarBand,
) -> Result<Link, Unregistered> {
    if !band.allows(left, found.right, REGISTERED_TOLERANCE) {
        return Err(UnmatchedReason::Epipolar.into());
    }
    let shortening = band.shortening(left);
    let [along, across] = found.evidence.sigma(oversampling, shortening);
    Ok(Link {
        evidence: Some(found.evidence),
        registered: true,
        ..Link::of_keypoints(found.right, found.correlation, [along, across * shortening])
    })
}

/// The link of a network whose registration `failed`, if its score is high enough: where that ended, which is nearer to the truth than the
/// keypoints that networks place on whole pixels, or where it was. On rendered pairs little more than half of those are right where
/// registration diverges or leaves the epipolar band: they are dropped.
///
/// # Errors
/// Why it is dropped.
fn unregistered(
    start: &Link,
    left: ViewPixel,
    failed: &Unregistered,
    compared: &Compared<'_>,
    band: &EpipolarBand,
) -> Result<Link, UnmatchedReason> {
    let Unregistered { reason, ended } = *failed;
    let is_hopeless = matches!(reason, UnmatchedReason::NotRefined | UnmatchedReason::Epipolar);
    if is_hopeless || start.score < LEAST_UNREGISTERED_SCORE {
        return Err(reason);
    }
    let Some(ended) = ended else { return Ok(*start) };
    if !band.allows(left, ended.right, REGISTERED_TOLERANCE) {
        return Err(UnmatchedReason::Epipolar);
    }
    let shortening = band.shortening(left);
    let [along, across] = ended.evidence.unregistered_sigma(compared.oversampling, shortening);
    Ok(Link { right: ended.right, evidence: Some(ended.evidence), sigma: [along, across * shortening], ..*start })
}

/// Drops links off the epipolar planes of the pose on which most links agree.
pub(crate) fn agree_on_pose(links: &mut Links, keypoints: &[Keypoint], grid: &Grid, pose_sigma: Angle) {
    let linked = links.iter().zip(keypoints);
    let bearing_pairs: Vec<_> =
        linked.filter_map(|(link, keypoint)| bearing_pair(grid, keypoint, link.as_ref().ok()?)).collect();
    let consensus = Consensus::of(&bearing_pairs, pose_sigma);
    let pixel = Angle::from_rad(1.0 / grid.pixels_per_radian());
    for (link, keypoint) in links.iter_mut().zip(keypoints) {
        *link = link.and_then(|link| {
            let off = bearing_pair(grid, keypoint, &link).and_then(|bearing_pair| consensus.off_plane(&bearing_pair));
            let (off, sigma) = off.ok_or(UnmatchedReason::Epipolar)?;
            let tolerance = pixel * (EPIPOLAR_SIGMAS * link.sigma[1]).max(REGISTERED_TOLERANCE);
            let off_plane = off.rad() / (pixel * link.sigma[1]).rad().hypot(sigma.rad());
            if off > tolerance + sigma * EpipolarBand::SIGMAS {
                Err(UnmatchedReason::Epipolar)
            } else {
                Ok(Link { off_plane, ..link })
            }
        });
    }
}

/// The bearings of a link in the shared axes.
pub(crate) fn bearing_pair(grid: &Grid, keypoint: &Keypoint, link: &Link) -> Option<BearingPair> {
    let sigma = Angle::from_rad(link.sigma[1] / grid.pixels_per_radian());
    Some(BearingPair { left: grid.bearing(keypoint.at)?, right: grid.bearing(link.right)?, sigma })
}

/// Both views prepared for the search of repetitions; `None` where they are too small.
pub(crate) struct Rows<'a>(Option<[Surroundings<'a>; 2]>);

impl<'a> Rows<'a> {
    pub(crate) fn of(compared: &Compared<'a>) -> Self {
        Self(Surroundings::of(compared.left).zip(Surroundings::of(compared.right)).map(<[_; 2]>::from))
    }

    /// Both views prepared in some of their rows.
    pub(crate) fn within(compared: &Compared<'a>, rows: &Range<usize>) -> Self {
        let [left, right] = [compared.left, compared.right].map(|view| Surroundings::within(view, rows.clone()));
        Self(left.zip(right).map(<[_; 2]>::from))
    }

    /// Drops links whose pattern a view repeats within the range of possible partners.
    pub(crate) fn drop_repeated(&self, links: &mut Links, keypoints: &[Keypoint], band: &EpipolarBand) {
        let Some([in_left, in_right]) = &self.0 else { return };
        links.par_iter_mut().zip(keypoints).for_each(|(link, keypoint)| {
            *link = link.and_then(|link| {
                let (l, r) = (keypoint.at, link.right);
                let farthest = band.largest_disparity(l.x);
                let distinct =
                    in_right.is_distinct(r, l.x - farthest, l.x) && in_left.is_distinct(l, r.x, r.x + farthest);
                if distinct { Ok(link) } else { Err(UnmatchedReason::Repeated) }
            });
        });
    }
}

/// Drops isolated links, then duplicates.
pub(crate) fn thin(links: &mut Links, keypoints: &[Keypoint]) {
    keep(links, keypoints, neighbours::supported, UnmatchedReason::Isolated);
    keep(
        links,
        keypoints,
        |placed| neighbours::duplicated(placed).iter().map(|d| !d).collect(),
        UnmatchedReason::Duplicate,
    );
}

/// Drops the links that `judge` rejects.
fn keep(
    links: &mut Links,
    keypoints: &[Keypoint],
    judge: impl Fn(&[PlacedMatch]) -> Vec<bool>,
    reason: UnmatchedReason,
) {
    let verdicts = judge(&placed(links, keypoints));
    for (link, kept) in links.iter_mut().filter(|link| link.is_ok()).zip(verdicts) {
        if !kept {
            *link = Err(reason);
        }
    }
}

/// The links that are matches, in their order.
pub(crate) fn placed(links: &Links, keypoints: &[Keypoint]) -> Vec<PlacedMatch> {
    let place = |(link, keypoint): (&Result<Link, UnmatchedReason>, &Keypoint)| {
        let link = link.as_ref().ok()?;
        let disparity = keypoint.at.x - link.right.x;
        Some(PlacedMatch { left: keypoint.at, disparity, score: link.score, sigma: link.sigma[0] })
    };
    links.iter().zip(keypoints).filter_map(place).collect()
}

/// Converts the links to matches in pixels of the original images.
pub(crate) fn in_originals(
    links: &Links,
    views: &SharedViews<'_>,
    keypoints: &[Keypoint],
    right_keypoints: usize,
) -> Matches {
    let mut matches = Matches { left_keypoints: keypoints.len(), right_keypoints, ..Matches::default() };
    let converted =
        |(keypoint, link): (&Keypoint, &Result<Link, _>)| link.and_then(|link| original(views, keypoint, &link));
    let converted: Vec<_> = keypoints.par_iter().zip(links).map(converted).collect();
    for link in converted {
        match link {
            Ok(found) => matches.pairs.push(found),
            Err(reason) => *matches.dropped.entry(reason).or_default() += 1,
        }
    }
    matches
}

fn original(views: &SharedViews<'_>, keypoint: &Keypoint, link: &Link) -> Result<Match, UnmatchedReason> {
    let (left_view, right_view) = (&views.left, &views.right);
    let left = left_view.original(keypoint.at).map_err(|_| UnmatchedReason::NotRefined)?;
    let right = right_view.original(link.right).map_err(|_| UnmatchedReason::NotRefined)?;
    let turns = link.sigma.map(|sigma| Angle::from_rad(sigma / left_view.grid().pixels_per_radian()));
    let sigma = views.pixel_sigma(turns, [left, right]).ok_or(UnmatchedReason::NotRefined)?;
    let (score, registered) = (link.right_probability as f32, link.registered);
    Ok(Match { left, right, sigma, score, registered, track: link.track })
}
