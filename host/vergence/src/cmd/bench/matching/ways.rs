//! The ways to match a pair.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};
use vergence_matching::learned::{LearnedMatcher, Picture};
use vergence_matching::{GuidedMatcher, ImagePair, Match, MatchError, Matcher, Matches};
use vergence_vision::{
    Angle, Gates, Left, Length, Pixel, PoseDrift, Right, SharedCovariance, StereoPair, Transform, cloud_of_each,
    pose_drift,
};

use super::judge::Tally;
use super::network_clock::NetworkClock;
use super::simulated_pair::SimulatedPair;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// How well the matchers are told the pose is known: to the width of an encoder's count and the play of a pinion.
const POSE_SIGMA: Angle = Angle::from_deg(0.15);
/// The pose's own standard deviation, of a turn in each direction and of a shift.
const STATED: (Angle, Length) = (Angle::from_deg(0.02), Length::from_mm(0.1));
const NEAREST: Length = Length::from_mm(200.0);
/// Networks place keypoints of whole images on whole pixels.
const RAW_SIGMA_PX: f64 = 0.6;

/// A way to match a pair.
pub enum Way<'a> {
    /// Networks on the whole fisheye images.
    Raw(&'a LearnedMatcher),
    /// Networks on views.
    Views(&'a LearnedMatcher),
    /// Without networks.
    Classical(GuidedMatcher),
}

/// What a way comes to.
pub struct Outcome {
    /// What looks alike.
    pub before: Tally,
    /// What passes the gates.
    pub after: Tally,
    /// Why the matcher dropped others.
    pub dropped: BTreeMap<&'static str, usize>,
    /// What the matches say of the pose.
    pub drift: Option<PoseDrift>,
    /// How long it took from the images to the points, and how much of that the networks ran.
    pub seconds: f64,
    pub network_seconds: f64,
}

impl<'a> Way<'a> {
    /// Those that can be had with the matchers there are.
    pub fn all(learned: Option<&'a LearnedMatcher>, guided: GuidedMatcher) -> Vec<Self> {
        let by_networks = learned.into_iter().flat_map(|learned| [Self::Raw(learned), Self::Views(learned)]);
        by_networks.chain([Self::Classical(guided)]).collect()
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::Raw(_) => "raw",
            Self::Views(_) => "views",
            Self::Classical(_) => "classical",
        }
    }

    /// Matches the pair, of which the right camera is said to be turned by `error` against the truth. The networks are
    /// watched by `clock`.
    ///
    /// # Errors
    /// Where a network fails.
    pub fn find(&self, pair: &SimulatedPair, error: Vector3<f64>, clock: &NetworkClock) -> Result<Outcome, Failure> {
        let truth = pair.left_from_right;
        let told: Transform<Left, Right> =
            Transform::new(UnitQuaternion::from_scaled_axis(-error) * truth.rotation(), truth.origin().mm());
        let images = ImagePair {
            left: &pair.left,
            right: &pair.right,
            left_camera: &pair.lens,
            right_camera: &pair.lens,
            left_from_right: told,
            pose_sigma: POSE_SIGMA,
            nearest: NEAREST,
        };
        let failed = |error: MatchError| Failure::check(error.to_string());
        let candidates = match self {
            Self::Raw(_) => None,
            Self::Views(matcher) => Some(matcher.candidates(&images).map_err(failed)?),
            Self::Classical(matcher) => Some(matcher.candidates(&images).map_err(failed)?),
        };
        clock.take();
        let watch = Stopwatch::start();
        let found = match self {
            Self::Raw(matcher) => Matches { pairs: whole(matcher, &images)?, ..Matches::default() },
            Self::Views(matcher) => matcher.find(&images).map_err(failed)?,
            Self::Classical(matcher) => matcher.find(&images).map_err(failed)?,
        };
        let matches = found.pairs;
        let dropped = found.dropped.into_iter().map(|(reason, count)| (reason.as_str(), count)).collect();
        let stereo = StereoPair { left: &pair.lens, right: &pair.lens, left_from_right: told };
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
        let (seconds, network_seconds) = (watch.seconds(), clock.take());
        // With a pose known to be wrong its gates say nothing: the matcher's own count then.
        let wrong = error.norm() > 0.0;
        let after = if wrong { Tally::of(&matches, pair) } else { Tally::of_points(&points, &matches, pair) };
        let before = Tally::of(candidates.as_ref().unwrap_or(&matches), pair);
        Ok(Outcome { before, after, dropped, drift, seconds, network_seconds })
    }
}

/// What the networks match in the images as they are.
fn whole(matcher: &LearnedMatcher, images: &ImagePair<'_>) -> Result<Vec<Match>, Failure> {
    let lit = |image: &image::GrayImage| -> Vec<f32> { image.iter().map(|&grey| f32::from(grey) / 255.0).collect() };
    let (left, right) = (lit(images.left), lit(images.right));
    let picture = |values, image: &image::GrayImage| Picture {
        values,
        width: image.width() as usize,
        height: image.height() as usize,
    };
    let pictures = [picture(&left, images.left), picture(&right, images.right)];
    let found = matcher
        .model()
        .compare(pictures, matcher.keypoints, [&|_| true, &|_| true])
        .map_err(|error| Failure::check(error.to_string()))?;
    let pixel = |[u, v]: [f32; 2]| Pixel { u: f64::from(u), v: f64::from(v) };
    let pair = |&(i, j, score): &(usize, usize, f32)| Match {
        left: pixel(found.keypoints[0][i]),
        right: pixel(found.keypoints[1][j]),
        sigma: RAW_SIGMA_PX,
        score,
    };
    Ok(found.matches.iter().map(pair).collect())
}
