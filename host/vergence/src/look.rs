//! From a pair of images and a pose to a cloud: match, gate, triangulate, colour. Pure.

use std::collections::BTreeMap;

use image::{RgbImage, imageops::grayscale};
use vergence_matching::{ImagePair, Match, MatchError, Matcher};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{
    Angle, CloudPoint, Gates, Kernel, Length, PixelPair, PoseDrift, SharedCovariance, StereoPair, cloud_of_each,
    pose_drift,
};

use crate::stopwatch::Stopwatch;

/// How well a position is known of which nothing is said, in pixels.
pub const PIXEL_SIGMA: f64 = 0.2;
/// Gates are this many standard deviations wide.
const GATE_SIGMAS: f64 = 3.0;
/// The nearest range at which points are looked for.
const NEAREST: Length = Length::from_mm(200.0);
/// The matcher looks at least this far off the known pose, so that a pose which is off can be noticed.
const LEAST_MATCHING_SIGMA: Angle = Angle::from_deg(0.15);
/// A point whose range is less certain than this part of it is of no use.
const MAX_RELATIVE_SIGMA: f64 = 0.05;

/// Two images of one instant.
#[derive(Clone, Copy, Debug)]
pub struct Eyes<'a> {
    /// Of the left camera.
    pub left: &'a RgbImage,
    /// Of the right camera.
    pub right: &'a RgbImage,
}

/// A point with its colour in the left image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColouredPoint {
    /// The point.
    pub point: CloudPoint,
    /// sRGB.
    pub colour: [u8; 3],
}

/// What a pair of images came to.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// The points.
    pub points: Vec<ColouredPoint>,
    /// Candidates that made no point, by reason. Those of the matcher count left keypoints, the others matches.
    pub dropped: BTreeMap<&'static str, usize>,
    /// What the matches say of the pose, where there are enough. Nothing was corrected by it.
    pub pose_drift: Option<PoseDrift>,
    /// How many matches there were.
    pub matches: usize,
    /// How long matching took.
    pub match_seconds: f64,
    /// How long triangulation took.
    pub triangulate_seconds: f64,
}

/// Matches two images and triangulates what passes the gates.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn look(eyes: Eyes<'_>, rig: &Rig, pose: &RigPose, matcher: &dyn Matcher) -> Result<Look, MatchError> {
    look_by(Kernel::default(), eyes, rig, pose, matcher)
}

/// The same by another method of triangulation.
///
/// # Errors
/// As [`look`].
pub fn look_by(
    kernel: Kernel,
    eyes: Eyes<'_>,
    rig: &Rig,
    pose: &RigPose,
    matcher: &dyn Matcher,
) -> Result<Look, MatchError> {
    let matching = Stopwatch::start();
    let (left, right) = (grayscale(eyes.left), grayscale(eyes.right));
    let found = matcher.find(&ImagePair {
        left: &left,
        right: &right,
        left_camera: &rig.left_camera,
        right_camera: &rig.right_camera,
        left_from_right: pose.left_from_right,
        pose_sigma: Angle::from_rad(pose.rotation_sigma.rad().max(LEAST_MATCHING_SIGMA.rad())),
        nearest: NEAREST,
    })?;
    let match_seconds = matching.seconds();
    let pair = |m: &Match| (PixelPair { left: m.left, right: m.right }, m.sigma);
    let pairs: Vec<_> = found.pairs.iter().map(pair).collect();
    let mut look = triangulate(&pairs, eyes, rig, pose, kernel);
    look.match_seconds = match_seconds;
    for (reason, count) in found.dropped {
        *look.dropped.entry(reason.as_str()).or_default() += count;
    }
    Ok(look)
}

/// Triangulates given correspondences, each with the standard deviation of its positions in pixels.
#[must_use]
pub fn triangulate(pairs: &[(PixelPair, f64)], eyes: Eyes<'_>, rig: &Rig, pose: &RigPose, kernel: Kernel) -> Look {
    let triangulation = Stopwatch::start();
    let stereo = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
    let result = cloud_of_each(pairs, &stereo, &Gates { kernel, ..gates(rig, pose) });
    let points = result
        .points
        .into_iter()
        .map(|point| ColouredPoint { point, colour: colour_at(eyes.left, point.pixels.left) })
        .collect();
    Look {
        points,
        pose_drift: pose_drift(pairs, &stereo, &pose.covariance),
        dropped: result.dropped.into_iter().map(|(reason, count)| (reason.as_str(), count)).collect(),
        matches: pairs.len(),
        match_seconds: 0.0,
        triangulate_seconds: triangulation.seconds(),
    }
}

/// Gates as wide as what is uncertain: pixels and pose.
fn gates(rig: &Rig, pose: &RigPose) -> Gates {
    let pixel = PIXEL_SIGMA / rig.left_camera.pixels_per_radian(Angle::from_rad(0.0));
    Gates {
        epipolar_sigmas: GATE_SIGMAS,
        min_parallax: Angle::from_rad(GATE_SIGMAS * std::f64::consts::SQRT_2 * pixel),
        max_range: None,
        pixel_sigma: PIXEL_SIGMA,
        max_relative_sigma: MAX_RELATIVE_SIGMA,
        shared: SharedCovariance::exact().with_pose(&pose.covariance),
        ..Gates::default()
    }
}

impl Look {
    /// A sentence where the picture disagrees with the pose by more than the pose is said to be off.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let drift = self.pose_drift.as_ref().filter(|drift| drift.is_significant())?;
        Some(format!(
            "the encoders and the picture disagree by {:.2}: nothing was corrected; calibrate again or check the mounts",
            drift.angle
        ))
    }
}

fn colour_at(image: &RgbImage, pixel: vergence_vision::Pixel) -> [u8; 3] {
    // Positions lie on the sensor, so rounding stays inside; the cast saturates if one ever does not.
    let (x, y) = (pixel.u.round().max(0.0) as u32, pixel.v.round().max(0.0) as u32);
    image.get_pixel_checked(x, y).map_or([0; 3], |colour| colour.0)
}
