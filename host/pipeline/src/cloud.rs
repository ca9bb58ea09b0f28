//! From a pair of images and a pose to a cloud: match, gate, triangulate, colour.

use std::collections::BTreeMap;

use image::RgbImage;
use vergence_alignment::{FusedPose, LensGrowth, PoseDrift, lens_growth, pose_drift};
use vergence_matching::{Match, MatchError, Matcher, Matches, UnmatchedReason};
use vergence_rig::{OpenLoop, Rig, RigPose, TrackGap, moving_cloud};
use vergence_vision::{
    Cloud, CloudPoint, DropReason, Kernel, Length, MatchSigma, PixelPair, StereoPair, cloud_of_each,
};

use crate::limits::{cloud_gates, expected_drift, matching_sigma};
use crate::pair::{PairImages, colour_at};
use crate::pose::PairPose;
use crate::pose_source::with_fused;
use crate::search::{EVERYWHERE, Search};
use crate::stage::Stage;
use crate::standing::StandingPose;

/// A point with its colour in the left image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColouredPoint {
    /// The point.
    pub point: CloudPoint,
    /// sRGB.
    pub colour: [u8; 3],
    /// The probability that the match is right, 0 to 1; 1 where the correspondences were given.
    pub score: f32,
    /// The number of the track of this place in the pairs before, where the matcher follows places.
    pub track: Option<u64>,
}

/// Candidates that made no point, counted by reason. The counts have different units and are never added: a left keypoint
/// without a match is no match.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Left keypoints for which the matcher found no match.
    pub keypoints: BTreeMap<UnmatchedReason, usize>,
    /// Matches that failed a gate of the cloud.
    pub matches: BTreeMap<DropReason, usize>,
}

/// The sparse result of one pair.
#[derive(Clone, Debug, Default)]
pub struct PairCloud {
    /// The points, in millimetres in the frame of the left camera (at its middle row, where the stages moved).
    pub points: Vec<ColouredPoint>,
    /// Left keypoints that the matcher tried; 0 where the correspondences were given.
    pub keypoints: usize,
    /// Matches: every one is a point, or counted in `dropped.matches`.
    pub matches: usize,
    /// Why the others made no point.
    pub dropped: Dropped,
    /// The correction of the pose by the joints that the matches ask for, where there are enough of them. It is not applied.
    pub pose_drift: Option<PoseDrift>,
    /// How much longer both lenses look than at their calibration, where there are enough matches. It is not applied.
    pub lens_growth: Option<LensGrowth>,
    /// Whether nothing is known of the calibration: the covariances of the points then lack its part.
    pub lacks_calibration: bool,
    /// The pose by which the points were made, where joints and matches told it together; else the joints told it alone.
    pub fused_pose: Option<FusedPose>,
    /// Number of pairs, this one included, whose matches told that pose.
    pub told_by_pairs: usize,
    /// Number of earlier visits to this position of the axes that told it.
    pub told_by_visits: usize,
}

impl PairCloud {
    /// The drift, where the matches disagree with the pose by more than its stated uncertainty.
    #[must_use]
    pub fn significant_drift(&self) -> Option<&PoseDrift> {
        self.pose_drift.as_ref().filter(|drift| drift.is_significant())
    }

    /// The growth of the lenses, where the matches show one that their stated uncertainty does not explain.
    #[must_use]
    pub fn significant_growth(&self) -> Option<&LensGrowth> {
        self.lens_growth.as_ref().filter(|growth| growth.is_significant())
    }

    /// Number of points where a lens is extrapolated.
    #[must_use]
    pub fn extrapolated(&self) -> usize {
        self.points.iter().filter(|point| point.point.extrapolated).count()
    }

    /// The pose by which the points were made, given that by the joints alone.
    #[must_use]
    pub fn pose(&self, by_joints: &RigPose) -> RigPose {
        self.fused_pose.as_ref().map_or_else(|| by_joints.clone(), |fused| with_fused(by_joints, fused))
    }
}

/// Rules by which a pair becomes points.
#[derive(Clone, Copy)]
pub struct Method<'a> {
    /// Finds homologous points.
    pub matcher: &'a dyn Matcher,
    /// Makes a point of two rays.
    pub kernel: Kernel,
    /// Where points are sought.
    pub search: &'a Search,
    /// Most points that there is time for; `None` for all.
    pub points: Option<usize>,
}

impl<'a> From<&'a dyn Matcher> for Method<'a> {
    /// Pseudo-intersection of what `matcher` finds everywhere.
    fn from(matcher: &'a dyn Matcher) -> Self {
        Self { matcher, kernel: Kernel::default(), search: &EVERYWHERE, points: None }
    }
}

/// Why a pair makes no cloud.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PairCloudError {
    /// The images cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// The joints at the exposure are not known.
    #[error(transparent)]
    Joints(#[from] TrackGap),
    /// The joints of a trunk cannot all stand where they read.
    #[error(transparent)]
    Trunk(#[from] OpenLoop),
}

/// Matches two images and triangulates the matches with the pose that the cameras had when each row was exposed. `ended`
/// hears of the end of each stage.
///
/// ```no_run
/// use image::RgbImage;
/// use vergence_matching::{GuidedMatcher, Matcher};
/// use vergence_pipeline::{Method, PairCloudError, PairImages, PairPose, pair_cloud};
/// use vergence_rig::Rig;
///
/// fn points(rig: &Rig, left: &RgbImage, right: &RgbImage) -> Result<usize, PairCloudError> {
///     // The axes at 145 mm and 60 degrees.
///     let pose = PairPose::standing(rig.pose_read_at(&[145.0, 60f64.to_radians()]));
///     let matcher: &dyn Matcher = &GuidedMatcher::default();
///     let cloud = pair_cloud(PairImages { left, right }, rig, &pose, Method::from(matcher), &mut |_| ())?;
///     Ok(cloud.points.len())
/// }
/// ```
///
/// # Errors
/// Where the images do not belong to the cameras, the cameras share no field, the joints of a row are not known, or the loop of a
/// trunk does not close as they read.
pub fn pair_cloud(
    images: PairImages<'_>,
    rig: &Rig,
    pose: &PairPose,
    method: Method<'_>,
    ended: &mut dyn FnMut(Stage),
) -> Result<PairCloud, PairCloudError> {
    refined_cloud(images, rig, pose, method, &mut StandingPose::default(), ended)
}

/// [`pair_cloud`] of a rig that may have stood for some pairs: the pose is told by their matches too, and `standing` keeps those of
/// this pair for the next one. Where the rig has moved, `standing` begins anew, with what it knows of earlier visits to the new place.
///
/// # Errors
/// As [`pair_cloud`].
pub fn refined_cloud(
    images: PairImages<'_>,
    rig: &Rig,
    pose: &PairPose,
    method: Method<'_>,
    standing: &mut StandingPose,
    ended: &mut dyn FnMut(Stage),
) -> Result<PairCloud, PairCloudError> {
    let middle = pose.at_middle();
    middle.check_closure()?;
    standing.forget_if_moved(rig, pose);
    let matched = |at: &RigPose| -> Result<_, MatchError> {
        let sigma = matching_sigma(at, pose.sweep());
        let found = images
            .with_grey((rig, method.search), at, sigma, |pair| method.matcher.find_at_most(pair, method.points))?;
        let pairs: Vec<_> = found.pairs.iter().map(Match::measured).collect();
        Ok((found, pairs))
    };
    let (mut found, mut pairs) = matched(&standing.best(rig, middle))?;
    // Each time less is left of what was known of the pose, and in the end the joints alone.
    while !standing.take(rig, pose, &pairs) {
        // It was looked for around a pose that the cameras have left.
        (found, pairs) = matched(&standing.best(rig, middle))?;
    }
    ended(Stage::Match);
    let cloud = cloud_of(&pairs, images.left, (rig, pose), standing, (method.kernel, method.search.farthest))?;
    ended(Stage::Triangulate);
    Ok(cloud.scored(found))
}

/// Triangulates given correspondences, each with the standard deviations of its positions in pixels (one number, or [`MatchSigma`]);
/// `left` colours the points.
///
/// # Errors
/// [`TrackGap`] where the joints of a row are not known.
pub fn cloud_of_pairs<S: Copy + Into<MatchSigma>>(
    pairs: &[(PixelPair, S)],
    left: &RgbImage,
    rig: &Rig,
    pose: &PairPose,
    kernel: Kernel,
) -> Result<PairCloud, TrackGap> {
    let pairs: Vec<_> = pairs.iter().map(|(pixels, sigma)| (*pixels, (*sigma).into())).collect();
    let mut standing = StandingPose::default();
    standing.take(rig, pose, &pairs);
    cloud_of(&pairs, left, (rig, pose), &standing, (kernel, None))
}

/// The cloud of `pairs`, which `standing` has taken.
fn cloud_of(
    pairs: &[(PixelPair, MatchSigma)],
    left: &RgbImage,
    (rig, pose): (&Rig, &PairPose),
    standing: &StandingPose,
    (kernel, farthest): (Kernel, Option<Length>),
) -> Result<PairCloud, TrackGap> {
    let middle = pose.at_middle();
    let fused = standing.refined().copied();
    let used = fused.map_or_else(|| middle.clone(), |fused| with_fused(middle, &fused));
    let gates = cloud_gates(rig, &used, kernel, farthest);
    let by_joints =
        StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: middle.left_from_right };
    let triangulated = || match pose.rows().filter(|_| fused.is_none()) {
        None => Ok(cloud_of_each(pairs, &StereoPair { left_from_right: used.left_from_right, ..by_joints }, &gates)),
        Some((motion, exposure)) => moving_cloud(pairs, rig, motion, exposure, &gates),
    };
    // While the pose turns by more than it is uncertain, one correction for all rows means nothing.
    let drifted = || {
        let drift = pose.is_steady().then(|| pose_drift(pairs, &by_joints, &expected_drift(middle))).flatten();
        // Nothing is too long where nothing is known of how long it is.
        let is_asked = |_: &PoseDrift| middle.is_calibration_known;
        let growth =
            drift.filter(is_asked).and_then(|drift| lens_growth(pairs, &by_joints, &drift.correction, &middle.shared));
        (drift, growth)
    };
    let (cloud, (drift, growth)) = rayon::join(triangulated, drifted);
    let Cloud { points, dropped } = cloud?;
    let coloured = |point: CloudPoint| {
        let colour = colour_at(left, point.pixels.left);
        ColouredPoint { point, colour, score: 1.0, track: None }
    };
    Ok(PairCloud {
        points: points.into_iter().map(coloured).collect(),
        keypoints: 0,
        matches: pairs.len(),
        dropped: Dropped { matches: dropped, ..Dropped::default() },
        pose_drift: drift,
        lens_growth: growth,
        lacks_calibration: !middle.is_calibration_known,
        fused_pose: fused,
        told_by_pairs: standing.pairs(),
        told_by_visits: if fused.is_some() { standing.visits(rig, middle) } else { 0 },
    })
}

impl PairCloud {
    /// Adds what only the matcher knows: scores, tracks, and keypoints without a match.
    fn scored(mut self, found: Matches) -> Self {
        for point in &mut self.points {
            let found = found.pairs.get(point.point.pair_index);
            point.score = found.map_or(0.0, |found| found.score);
            point.track = found.and_then(|found| found.track);
        }
        self.keypoints = found.left_keypoints;
        self.dropped.keypoints = found.dropped;
        self
    }
}
