//! The classical matcher: corners, gradient histograms compared inside the epipolar band, and registration.

use rayon::prelude::*;
use vergence_vision::Angle;

use crate::corners::{self, Keypoint};
use crate::descriptor::Descriptor;
use crate::epipolar_band::EpipolarBand;
use crate::links::{Compared, Link, Links, Rows, agree_on_pose, bearing_pair, in_originals, register, thin};
use crate::match_errors::state_errors;
use crate::matcher::{ImagePair, Match, MatchError, Matcher, Matches, UnmatchedReason};
use crate::plane::Pyramid;
use crate::pool::in_pool;
use crate::shared_views::SharedViews;
use crate::wrong_pose::{ANY_POSE, pose_instead};

/// A matcher of corners by their gradient histograms, guided by the stated pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedMatcher {
    /// Largest number of keypoints per view.
    pub keypoints: usize,
    /// Pixels of the view per pixel at the centre of the denser fisheye image, from 1 to 2. `None` takes the value that
    /// gives 450 pixels per radian, so that small images are enlarged.
    pub oversampling: Option<f64>,
}

impl Default for GuidedMatcher {
    fn default() -> Self {
        Self { keypoints: 4000, oversampling: None }
    }
}

/// Number of pyramid levels in which keypoints are detected.
pub(crate) const LEVELS: usize = 3;
/// Tolerance of a keypoint's position, in pixels of its level.
pub(crate) const KEYPOINT_TOLERANCE: f64 = 1.5;
/// Standard deviation of a corner's position, in pixels of its level.
const CORNER_SIGMA: f64 = 0.7;
/// Fraction of matched keypoints below which the stated pose may be wrong by degrees.
const SUSPICIOUSLY_FEW: f64 = 0.05;
/// Squared distance of descriptors above which they are not of the same point.
const FARTHEST_SQUARED: f32 = 0.6;
/// Largest squared ratio of the best distance to the best one elsewhere (Lowe 2004, §7.1: 0.8 without guidance).
const RATIO_SQUARED: f32 = 0.85 * 0.85;
/// Keypoints within this distance, in pixels of their level, count as one position for the ratio.
const SAME_PLACE: f64 = 4.0;

impl Matcher for GuidedMatcher {
    fn name(&self) -> &'static str {
        "guided"
    }

    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        pair.check()?;
        in_pool(|| self.found(pair))
    }
}

impl GuidedMatcher {
    fn found(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        let views = SharedViews::of(pair, self.oversampling)?;
        let (pyramids, seen) = self.features(&views);
        let matches = matched(&views, &pyramids, &seen, pair.pose_sigma);
        if !are_suspiciously_few(&matches) {
            return Ok(matches);
        }
        let links = compare(&seen[0], &seen[1], &views.band_for(ANY_POSE));
        let candidate = |(keypoint, link): (&Keypoint, &Result<Link, UnmatchedReason>)| {
            bearing_pair(&views.grid, keypoint, link.as_ref().ok()?)
        };
        let candidates: Vec<_> = seen[0].keypoints.iter().zip(&links).filter_map(candidate).collect();
        let Some(pose) = pose_instead(&candidates, &views, pair) else { return Ok(matches) };
        let turned = ImagePair { left_from_right: pose, ..*pair };
        let views = SharedViews::of(&turned, self.oversampling)?;
        let (pyramids, seen) = self.features(&views);
        Ok(matched(&views, &pyramids, &seen, pair.pose_sigma))
    }

    /// Finds candidates inside the epipolar band by their descriptors, before registration and every other test.
    ///
    /// # Errors
    /// The errors of [`Matcher::find`].
    pub fn candidates(&self, pair: &ImagePair<'_>) -> Result<Vec<Match>, MatchError> {
        pair.check()?;
        let views = SharedViews::of(pair, self.oversampling)?;
        let (_, [left, right]) = self.features(&views);
        let links = compare(&left, &right, &views.band());
        Ok(in_originals(&links, &views, &left.keypoints, right.keypoints.len()).pairs)
    }

    fn features(&self, views: &SharedViews<'_>) -> ([Pyramid; 2], [Features; 2]) {
        let pyramids = [views.left.plane(), views.right.plane()].map(|plane| Pyramid::new(plane, LEVELS));
        let [left, right] = &pyramids;
        let seen = [
            corners::detect(left, self.keypoints, |keypoint| views.shared_from_left(keypoint)),
            corners::detect(right, self.keypoints, |keypoint| views.shared_from_right(keypoint)),
        ];
        let [in_left, in_right] = seen;
        let features = [Features::of(left, in_left), Features::of(right, in_right)];
        (pyramids, features)
    }
}

/// Whether so few keypoints found a partner that the stated pose may be wrong by degrees.
pub(crate) fn are_suspiciously_few(matches: &Matches) -> bool {
    let fewer = matches.left_keypoints.min(matches.right_keypoints) as f64;
    (matches.pairs.len() as f64) < SUSPICIOUSLY_FEW * fewer
}

/// Matches the features of both views and applies all tests.
fn matched(
    views: &SharedViews<'_>,
    pyramids: &[Pyramid; 2],
    [left, right]: &[Features; 2],
    pose_sigma: Angle,
) -> Matches {
    let band = views.band();
    let compared = Compared {
        left: &pyramids[0],
        right: &pyramids[1],
        keypoints: &left.keypoints,
        oversampling: views.oversampling(),
    };
    let mut links = compare(left, right, &band);
    register(&mut links, &compared, &band, false);
    agree_on_pose(&mut links, &left.keypoints, &views.grid, pose_sigma);
    Rows::of(&compared).drop_repeated(&mut links, &left.keypoints, &band);
    thin(&mut links, &left.keypoints);
    state_errors(&mut links, &compared, &band);
    in_originals(&links, views, &left.keypoints, right.keypoints.len())
}

/// The keypoints of one view with their descriptors.
pub(crate) struct Features {
    /// Sorted by rows.
    pub keypoints: Vec<Keypoint>,
    descriptors: Vec<Descriptor>,
}

impl Features {
    /// Describes keypoints that are sorted by rows.
    pub(crate) fn of(pyramid: &Pyramid, keypoints: Vec<Keypoint>) -> Self {
        let describe = |keypoint: &Keypoint| {
            let scale = (1_usize << keypoint.level) as f64;
            Descriptor::at(&pyramid.levels()[keypoint.level], keypoint.at.x / scale, keypoint.at.y / scale)
        };
        let descriptors = keypoints.par_iter().map(describe).collect();
        Self { keypoints, descriptors }
    }

    /// Indices of the keypoints within `reach` rows of y.
    fn near_row(&self, y: f64, reach: f64) -> std::ops::Range<usize> {
        let start = self.keypoints.partition_point(|keypoint| keypoint.at.y < y - reach);
        let end = self.keypoints.partition_point(|keypoint| keypoint.at.y <= y + reach);
        start..end.max(start)
    }
}

/// Finds the most similar keypoint of `to` for every keypoint of `from`.
fn nearest(
    from: &Features,
    to: &Features,
    reach: f64,
    allowed: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<Result<usize, UnmatchedReason>> {
    let partner = |i: usize| {
        let (keypoint, descriptor) = (&from.keypoints[i], &from.descriptors[i]);
        let scale = (1_usize << keypoint.level) as f64;
        let candidates: Vec<(usize, f32)> = to
            .near_row(keypoint.at.y, reach * scale)
            .filter(|&j| to.keypoints[j].level == keypoint.level && allowed(i, j))
            .map(|j| (j, descriptor.distance_squared(&to.descriptors[j])))
            .collect();
        let &(best, least) =
            candidates.iter().min_by(|p, q| p.1.total_cmp(&q.1)).ok_or(UnmatchedReason::NoCandidate)?;
        if least > FARTHEST_SQUARED {
            return Err(UnmatchedReason::NoCandidate);
        }
        let place = to.keypoints[best].at;
        let elsewhere = |j: usize| {
            let at = to.keypoints[j].at;
            (at.x - place.x).hypot(at.y - place.y) > SAME_PLACE * scale
        };
        let rivalled = candidates.iter().any(|&(j, d)| least > RATIO_SQUARED * d && elsewhere(j));
        if rivalled { Err(UnmatchedReason::Ratio) } else { Ok(best) }
    };
    (0..from.keypoints.len()).into_par_iter().map(partner).collect()
}

/// Links every left keypoint to its most similar right one, if the choice is mutual.
pub(crate) fn compare(left: &Features, right: &Features, band: &EpipolarBand) -> Links {
    let tolerance = |keypoint: &Keypoint| KEYPOINT_TOLERANCE * (1_usize << keypoint.level) as f64;
    let partners: Vec<_> = left.keypoints.iter().map(|keypoint| band.of(keypoint.at, tolerance(keypoint))).collect();
    let allowed = |l: usize, r: usize| partners[l].holds(right.keypoints[r].at);
    let reach = band.reach(KEYPOINT_TOLERANCE);
    let (forth, back) =
        rayon::join(|| nearest(left, right, reach, allowed), || nearest(right, left, reach, |r, l| allowed(l, r)));
    let link = |(i, partner): (usize, &Result<usize, UnmatchedReason>)| {
        let j = (*partner)?;
        let (from, to) = (&left.keypoints[i], &right.keypoints[j]);
        let sigma = CORNER_SIGMA * (1_usize << from.level) as f64;
        if back[j] == Ok(i) { Ok(Link::of_keypoints(to.at, 0.0, [sigma; 2])) } else { Err(UnmatchedReason::NotMutual) }
    };
    forth.iter().enumerate().map(link).collect()
}
