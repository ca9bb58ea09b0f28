//! The classical matcher: corners, gradient histograms compared inside the epipolar band, registration.

use rayon::prelude::*;
use vergence_vision::{Angle, Frame, Left, Right, UnitRay};

use crate::consensus::Consensus;
use crate::corners::{self, Keypoint};
use crate::descriptor::Descriptor;
use crate::distinct::Surroundings;
use crate::epipolar_band::EpipolarBand;
use crate::matcher::{Drop, ImagePair, Match, MatchError, Matcher, Matches};
use crate::neighbours::{self, Placed};
use crate::plane::Pyramid;
use crate::refine;
use crate::shared_field::SharedField;
use crate::{Grid, Shared, SharedFrame, View, ViewPixel};

/// Matches corners by their gradient histograms, guided by the known pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedMatcher {
    /// Most keypoints per view.
    pub keypoints: usize,
    /// Pixels of the view per pixel at the centre of the denser fisheye image, from 1 to 2. `None` takes what makes
    /// 450 pixels per radian, so that small images are enlarged.
    pub oversampling: Option<f64>,
}

impl Default for GuidedMatcher {
    fn default() -> Self {
        Self { keypoints: 4000, oversampling: None }
    }
}

/// Resolutions in which keypoints are sought.
pub(crate) const LEVELS: usize = 3;
/// Density of a view in pixels per radian that small images are enlarged to and large ones need not exceed.
pub(crate) const DENSITY: f64 = 450.0;
/// How far a keypoint may be off, in pixels of its level.
pub(crate) const KEYPOINT_TOLERANCE: f64 = 1.5;
/// How far off the epipolar curve a registered match may be, in pixels, where the pose is exact.
const REGISTERED_TOLERANCE: f64 = 1.2;
/// Standard deviation of that, in pixels.
const REGISTERED_SIGMA: f64 = 0.3;
/// Distance beyond which two descriptors do not show the same thing, squared.
const FARTHEST_SQUARED: f32 = 0.6;
/// Largest ratio of the best distance to that of the best elsewhere (Lowe 2004, §7.1: 0.8 without guidance), squared.
const RATIO_SQUARED: f32 = 0.85 * 0.85;
/// Keypoints within this distance are the same place for the ratio, in pixels of their level.
const SAME_PLACE: f64 = 4.0;

impl Matcher for GuidedMatcher {
    fn name(&self) -> &'static str {
        "guided"
    }

    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        pair.check()?;
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let oversampling = self.oversampling.filter(|o| o.is_finite()).unwrap_or(DENSITY / density).clamp(1.0, 2.0);
        let grid = Grid::covering(&frame, pair.left_camera, pair.right_camera, oversampling)
            .ok_or(MatchError::NoSharedField)?;
        let field = SharedField::new(&frame, pair.left_camera, pair.right_camera);
        let left_view: View<Left> = View::new(pair.left, pair.left_camera, frame.shared_from_left(), grid);
        let right_view: View<Right> = View::new(pair.right, pair.right_camera, frame.shared_from_right(), grid);
        let left = Features::of(&left_view, self.keypoints, |bearing| field.seen_from_left(bearing));
        let right = Features::of(&right_view, self.keypoints, |bearing| field.seen_from_right(bearing));

        let band = EpipolarBand::new(grid, frame.baseline(), pair.nearest, pair.pose_sigma);
        let mut links = compare(&left, &right, &band);
        register(&mut links, &left, &right, &band);
        agree_on_pose(&mut links, &left, &grid, pair.pose_sigma);
        drop_repeated(&mut links, &left, &right, &band);
        keep(&mut links, &left, neighbours::supported, Drop::Isolated);
        keep(&mut links, &left, |placed| neighbours::duplicated(placed).iter().map(|d| !d).collect(), Drop::Duplicate);

        let mut matches = Matches {
            left_keypoints: left.keypoints.len(),
            right_keypoints: right.keypoints.len(),
            ..Matches::default()
        };
        for (keypoint, link) in left.keypoints.iter().zip(&links) {
            match link.and_then(|link| in_originals(&left_view, &right_view, keypoint, &link)) {
                Ok(found) => matches.pairs.push(found),
                Err(reason) => *matches.dropped.entry(reason).or_default() += 1,
            }
        }
        Ok(matches)
    }
}

/// What is compared of one view.
pub(crate) struct Features {
    pub pyramid: Pyramid,
    /// By rows.
    pub keypoints: Vec<Keypoint>,
    pub descriptors: Vec<Descriptor>,
}

impl Features {
    fn of<F: Frame>(view: &View<F>, budget: usize, shared: impl Fn(&UnitRay<Shared>) -> bool + Sync) -> Self {
        let pyramid = Pyramid::new(view.plane(), LEVELS);
        let compared = |keypoint: &Keypoint| {
            surrounded(view, keypoint) && view.grid().bearing(keypoint.at).is_some_and(|bearing| shared(&bearing))
        };
        let keypoints = corners::detect(&pyramid, budget, compared);
        let describe = |keypoint: &Keypoint| {
            let scale = (1_usize << keypoint.level) as f64;
            Descriptor::at(&pyramid.levels()[keypoint.level], keypoint.at.x / scale, keypoint.at.y / scale)
        };
        let descriptors = keypoints.par_iter().map(describe).collect();
        Self { pyramid, keypoints, descriptors }
    }

    /// Indices of the keypoints within `reach` rows of y.
    fn near_row(&self, y: f64, reach: f64) -> std::ops::Range<usize> {
        let start = self.keypoints.partition_point(|keypoint| keypoint.at.y < y - reach);
        let end = self.keypoints.partition_point(|keypoint| keypoint.at.y <= y + reach);
        start..end.max(start)
    }
}

/// Whether the camera sees all around a keypoint: its rim would look like an edge of the scene.
pub(crate) fn surrounded<F: Frame>(view: &View<F>, keypoint: &Keypoint) -> bool {
    const MARGIN: f64 = 6.0; // of the level
    let reach = MARGIN * (1_usize << keypoint.level) as f64;
    let ViewPixel { x, y } = keypoint.at;
    [-reach, 0.0, reach]
        .iter()
        .all(|dy| [-reach, 0.0, reach].iter().all(|dx| view.sees(ViewPixel { x: x + dx, y: y + dy })))
}

/// A left keypoint's partner in the right view.
#[derive(Clone, Copy)]
pub(crate) struct Link {
    pub right: ViewPixel,
    pub score: f64,
}

/// One entry for every left keypoint.
pub(crate) type Links = Vec<Result<Link, Drop>>;

/// The most alike keypoint of `to` for every keypoint of `from`.
fn nearest(
    from: &Features,
    to: &Features,
    reach: f64,
    allowed: impl Fn(&Keypoint, &Keypoint) -> bool + Sync,
) -> Vec<Result<usize, Drop>> {
    let partner = |i: usize| {
        let (keypoint, descriptor) = (&from.keypoints[i], &from.descriptors[i]);
        let scale = (1_usize << keypoint.level) as f64;
        let candidates: Vec<(usize, f32)> = to
            .near_row(keypoint.at.y, reach * scale)
            .filter(|&j| to.keypoints[j].level == keypoint.level && allowed(keypoint, &to.keypoints[j]))
            .map(|j| (j, descriptor.distance_squared(&to.descriptors[j])))
            .collect();
        let &(best, least) = candidates.iter().min_by(|p, q| p.1.total_cmp(&q.1)).ok_or(Drop::NoCandidate)?;
        if least > FARTHEST_SQUARED {
            return Err(Drop::NoCandidate);
        }
        let place = to.keypoints[best].at;
        let elsewhere = |j: usize| {
            let at = to.keypoints[j].at;
            (at.x - place.x).hypot(at.y - place.y) > SAME_PLACE * scale
        };
        let rivalled = candidates.iter().any(|&(j, d)| least > RATIO_SQUARED * d && elsewhere(j));
        if rivalled { Err(Drop::Ratio) } else { Ok(best) }
    };
    (0..from.keypoints.len()).into_par_iter().map(partner).collect()
}

/// Links every left keypoint to the right one it prefers, if that prefers it too.
fn compare(left: &Features, right: &Features, band: &EpipolarBand) -> Links {
    let tolerance = |keypoint: &Keypoint| KEYPOINT_TOLERANCE * (1_usize << keypoint.level) as f64;
    let allowed = |l: &Keypoint, r: &Keypoint| band.allows(l.at, r.at, tolerance(l));
    let reach = band.reach(KEYPOINT_TOLERANCE);
    let forth = nearest(left, right, reach, allowed);
    let back = nearest(right, left, reach, |r, l| allowed(l, r));
    let link = |(i, partner): (usize, &Result<usize, Drop>)| {
        let j = (*partner)?;
        let mutual = back[j] == Ok(i);
        if mutual { Ok(Link { right: right.keypoints[j].at, score: 0.0 }) } else { Err(Drop::NotMutual) }
    };
    forth.iter().enumerate().map(link).collect()
}

/// Replaces every link's right position by the registered one, and drops what the pose does not allow there.
pub(crate) fn register(links: &mut Links, left: &Features, right: &Features, band: &EpipolarBand) {
    let pyramids = [&left.pyramid, &right.pyramid];
    links.par_iter_mut().zip(&left.keypoints).for_each(|(link, keypoint)| {
        *link = link.and_then(|start| {
            let registered = refine::register(pyramids, keypoint.at, start.right, keypoint.level)?;
            if !band.allows(keypoint.at, registered.right, REGISTERED_TOLERANCE) {
                return Err(Drop::Epipolar);
            }
            Ok(Link { right: registered.right, score: registered.correlation })
        });
    });
}

/// Drops what is off the epipolar planes of the pose that the links agree on.
pub(crate) fn agree_on_pose(links: &mut Links, left: &Features, grid: &Grid, pose_sigma: Angle) {
    let pixel = Angle::from_rad(1.0 / grid.pixels_per_radian());
    let bearings = |keypoint: &Keypoint, link: &Link| Some([grid.bearing(keypoint.at)?, grid.bearing(link.right)?]);
    let linked = links.iter().zip(&left.keypoints);
    let pairs: Vec<_> = linked.filter_map(|(link, keypoint)| bearings(keypoint, link.as_ref().ok()?)).collect();
    let consensus = Consensus::of(&pairs, pose_sigma, pixel * REGISTERED_SIGMA);
    for (link, keypoint) in links.iter_mut().zip(&left.keypoints) {
        *link = link.and_then(|link| {
            let (off, sigma) =
                bearings(keypoint, &link).and_then(|pair| consensus.off_plane(&pair)).ok_or(Drop::Epipolar)?;
            let allowed = pixel * REGISTERED_TOLERANCE + sigma * EpipolarBand::SIGMAS;
            if off > allowed { Err(Drop::Epipolar) } else { Ok(link) }
        });
    }
}

/// Drops what a view shows again where the partner might lie.
pub(crate) fn drop_repeated(links: &mut Links, left: &Features, right: &Features, band: &EpipolarBand) {
    let (Some(in_left), Some(in_right)) = (Surroundings::of(&left.pyramid), Surroundings::of(&right.pyramid)) else {
        return;
    };
    links.par_iter_mut().zip(&left.keypoints).for_each(|(link, keypoint)| {
        *link = link.and_then(|link| {
            let (l, r) = (keypoint.at, link.right);
            let farthest = band.largest_disparity(l.x);
            let distinct = in_right.is_distinct(r, l.x - farthest, l.x) && in_left.is_distinct(l, r.x, r.x + farthest);
            if distinct { Ok(link) } else { Err(Drop::Repeated) }
        });
    });
}

/// Drops the links that `judge` rejects.
pub(crate) fn keep(links: &mut Links, left: &Features, judge: impl Fn(&[Placed]) -> Vec<bool>, reason: Drop) {
    let place = |(link, keypoint): (&Result<Link, Drop>, &Keypoint)| {
        let link = link.as_ref().ok()?;
        Some(Placed { left: keypoint.at, disparity: keypoint.at.x - link.right.x, score: link.score })
    };
    let placed: Vec<Placed> = links.iter().zip(&left.keypoints).filter_map(place).collect();
    let verdicts = judge(&placed);
    for (link, kept) in links.iter_mut().filter(|link| link.is_ok()).zip(verdicts) {
        if !kept {
            *link = Err(reason);
        }
    }
}

/// The match in pixels of the original images.
pub(crate) fn in_originals(
    left_view: &View<Left>,
    right_view: &View<Right>,
    keypoint: &Keypoint,
    link: &Link,
) -> Result<Match, Drop> {
    let left = left_view.original(keypoint.at).map_err(|_| Drop::NotRefined)?;
    let right = right_view.original(link.right).map_err(|_| Drop::NotRefined)?;
    Ok(Match { left, right, score: link.score as f32 })
}
