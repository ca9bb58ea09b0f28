//! The ways to match a pair.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};
use vergence_alignment::{PoseDrift, pose_drift};
use vergence_matching::learned::{GreyImage, LearnedMatcher};
use vergence_matching::{GuidedMatcher, ImagePair, Match, MatchError, Matcher, Matches};
use vergence_vision::{
    Angle, Gates, Left, Length, Pixel, Right, SharedCovariance, StereoPair, Transform, cloud_of_each,
};

use crate::error::BenchError;
use crate::matching::judge::Tally;
use crate::matching::network_clock::NetworkClock;
use crate::matching::simulated_pair::SimulatedPair;

/// Standard deviation of the pose that the matchers are given: the width of an encoder's count and the play of a pinion.
const POSE_SIGMA: Angle = Angle::from_deg(0.15);
/// The nearest range at which points are sought.
const NEAREST: Length = Length::from_mm(200.0);
/// Standard deviation of the pose in the cloud: of a rotation about each axis, and of a shift along it.
const STATED: (Angle, Length) = (Angle::from_deg(0.02), Length::from_mm(0.1));
/// Standard deviation of keypoints in whole images, which networks place on whole pixels.
const RAW_SIGMA_PX: f64 = 0.6;

/// A way to match a pair.
pub enum Way<'a> {
    /// Networks, on the whole fisheye images.
    Raw(&'a LearnedMatcher),
    /// Networks, on views.
    Views(&'a LearnedMatcher),
    /// The classical matcher.
    Classical(GuidedMatcher),
}

/// Result of a way.
pub struct Outcome {
    /// Candidates.
    pub before: Tally,
    /// Matches that pass the gates.
    pub after: Tally,
    /// Candidates that the matcher dropped, by reason.
    pub dropped: BTreeMap<&'static str, usize>,
    /// Drift of the pose by the matches.
    pub drift: Option<PoseDrift>,
    /// Seconds from the images to the points.
    pub seconds: f64,
    /// The part of them in which networks ran.
    pub network_seconds: f64,
}

impl<'a> Way<'a> {
    /// The ways that are possible with these matchers.
    #[must_use]
    pub fn all(learned: Option<&'a LearnedMatcher>, guided: GuidedMatcher) -> Vec<Self> {
        let by_networks = learned.into_iter().flat_map(|learned| [Self::Raw(learned), Self::Views(learned)]);
        by_networks.chain([Self::Classical(guided)]).collect()
    }

    /// The name in tables.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Raw(_) => "raw",
            Self::Views(_) => "views",
            Self::Classical(_) => "classical",
        }
    }

    /// Matches the pair. The matcher is given a pose whose right camera is turned by `error` (a rotation vector in radians)
    /// against the truth. `networks` watches the networks.
    ///
    /// # Errors
    /// Where a network fails.
    pub fn find(
        &self,
        pair: &SimulatedPair,
        error: Vector3<f64>,
        networks: &NetworkClock,
    ) -> Result<Outcome, BenchError> {
        let truth = pair.left_from_right;
        let stated: Transform<Left, Right> =
            Transform::new(UnitQuaternion::from_scaled_axis(-error) * truth.rotation(), truth.origin().mm());
        let images = ImagePair {
            left: &pair.left,
            right: &pair.right,
            left_camera: &pair.lens,
            right_camera: &pair.lens,
            left_from_right: stated,
            pose_sigma: POSE_SIGMA,
            nearest: NEAREST,
            masks: [None; 2],
        };
        let failed = |error: MatchError| BenchError::Work(error.to_string());
        let candidates = match self {
            Self::Raw(_) => None,
            Self::Views(matcher) => Some(matcher.candidates(&images).map_err(failed)?),
            Self::Classical(matcher) => Some(matcher.candidates(&images).map_err(failed)?),
        };
        networks.take();
        let start = networks.now();
        let found = match self {
            Self::Raw(matcher) => Matches { pairs: whole(matcher, &images)?, ..Matches::default() },
            Self::Views(matcher) => matcher.find(&images).map_err(failed)?,
            Self::Classical(matcher) => matcher.find(&images).map_err(failed)?,
        };
        let matches = found.pairs;
        let dropped = found.dropped.into_iter().map(|(reason, count)| (reason.as_str(), count)).collect();
        let stereo = StereoPair { left: &pair.lens, right: &pair.lens, left_from_right: stated };
        let pixels: Vec<_> = matches.iter().map(Match::measured).collect();
        let (turn, shift) = (STATED.0.rad().powi(2), STATED.1.mm().powi(2));
        let stated = Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift));
        let drift = pose_drift(&pixels, &stereo, &stated);
        let gates = Gates {
            shared: SharedCovariance::exact().with_pose(&stated),
            max_relative_sigma: f64::INFINITY,
            ..Gates::default()
        };
        let points = cloud_of_each(&pixels, &stereo, &gates).points;
        let (seconds, network_seconds) = ((networks.now() - start).as_secs_f64(), networks.take());
        // The gates of a pose that is known to be wrong mean nothing: the matches count then.
        let wrong = error.norm() > 0.0;
        let after = if wrong { Tally::of(&matches, pair) } else { Tally::of_points(&points, &matches, pair) };
        let before = Tally::of(candidates.as_ref().unwrap_or(&matches), pair);
        Ok(Outcome { before, after, dropped, drift, seconds, network_seconds })
    }
}

/// Matches of the networks in the whole images.
fn whole(matcher: &LearnedMatcher, images: &ImagePair<'_>) -> Result<Vec<Match>, BenchError> {
    let lit = |image: &image::GrayImage| -> Vec<f32> { image.iter().map(|&grey| f32::from(grey) / 255.0).collect() };
    let (left, right) = (lit(images.left), lit(images.right));
    let picture = |values, image: &image::GrayImage| GreyImage {
        values,
        width: image.width() as usize,
        height: image.height() as usize,
    };
    let pictures = [picture(&left, images.left), picture(&right, images.right)];
    let found = matcher
        .model()
        .compare(pictures, matcher.keypoints, [&|_| true, &|_| true])
        .map_err(|error| BenchError::Work(error.to_string()))?;
    let pixel = |[u, v]: [f32; 2]| Pixel { u: f64::from(u), v: f64::from(v) };
    let pair = |&(i, j, score): &(usize, usize, f32)| Match {
        left: pixel(found.keypoints[0][i]),
        right: pixel(found.keypoints[1][j]),
        sigma: RAW_SIGMA_PX.into(),
        score,
        registered: false,
        track: None,
    };
    Ok(found.matches.iter().map(pair).collect())
}
