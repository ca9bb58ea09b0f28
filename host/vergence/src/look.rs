//! From a pair of images and a pose to a cloud: match, gate, triangulate, colour. Pure.

use std::collections::BTreeMap;

use image::{RgbImage, imageops::grayscale};
use vergence_matching::{ImagePair, Match, MatchError, Matcher, Matches, image_corners};
use vergence_rig::{Joints, MiddlePose, PairExposure, Rig, RigPose, TrackGap, middle_pose, moving_cloud};
use vergence_vision::{
    Angle, Camera as CameraFrame, Cloud, CloudPoint, Gates, KannalaBrandt, Kernel, Length, Pixel, PixelPair, PoseDrift,
    SharedCovariance, StereoPair, UnitRay, cloud_of_each, pose_drift,
};

use crate::stopwatch::Stopwatch;

/// How well a position is known of which nothing is said, in pixels.
pub const PIXEL_SIGMA: f64 = 0.2;
/// Gates are this many standard deviations wide.
const GATE_SIGMAS: f64 = 3.0;
/// The nearest range at which points are looked for.
pub const NEAREST: Length = Length::from_mm(200.0);
/// The matcher looks at least this far off the known pose, so that a pose which is off can be noticed.
const LEAST_MATCHING_SIGMA: Angle = Angle::from_deg(0.15);
/// A point whose range is less certain than this part of it is of no use.
pub const MAX_RELATIVE_SIGMA: f64 = 0.05;

/// How well a corner of a single image is known, in pixels: no other image has registered it.
const CORNER_SIGMA: f64 = 0.5;
/// One camera alone gives at most so many directions.
const MOST_BEARINGS: usize = 2000;

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
    /// How alike the matcher found both sights, 0 to 1; 1 where somebody else matched them.
    pub score: f32,
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
    let (found, match_seconds) = matches(eyes, rig, pose, Angle::default(), matcher)?;
    let pairs = pixel_pairs(&found);
    Ok(Look { match_seconds, ..triangulate(&pairs, eyes, rig, pose, kernel) }.of_matches(&found))
}

/// Why a pair that was exposed in motion makes no cloud.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LookError {
    /// The images cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// The joints at the exposure are not known.
    #[error(transparent)]
    Joints(#[from] TrackGap),
}

/// Matches two images and triangulates them with the pose that the cameras had when each row was exposed: the stages may
/// move. Points are in the frame of the left camera at its middle row; the pose there comes with them. While the pose turns
/// by more than it is uncertain, no word on its drift is to be had.
///
/// # Errors
/// [`LookError`].
pub fn look_exposed(
    eyes: Eyes<'_>,
    rig: &Rig,
    joints: &impl Joints,
    exposure: &PairExposure,
    matcher: &dyn Matcher,
) -> Result<(Look, MiddlePose), LookError> {
    let middle = middle_pose(rig, joints, exposure)?;
    let (found, match_seconds) = matches(eyes, rig, &middle.pose, middle.sweep, matcher)?;
    let pairs = pixel_pairs(&found);
    let triangulation = Stopwatch::start();
    let cloud = moving_cloud(&pairs, rig, joints, exposure, &gates(rig, &middle.pose))?;
    let triangulate_seconds = triangulation.seconds();
    let stands = middle.sweep < middle.pose.rotation_sigma;
    let drift = || pose_drift(&pairs, &stereo(rig, &middle.pose), &middle.pose.covariance);
    let look = Look {
        pose_drift: stands.then(drift).flatten(),
        matches: pairs.len(),
        match_seconds,
        triangulate_seconds,
        ..Look::of_cloud(cloud, eyes)
    };
    Ok((look.of_matches(&found), middle))
}

/// The homologous points, and how long finding them took. `sweep` is how far the pose turns while the images are exposed.
fn matches(
    eyes: Eyes<'_>,
    rig: &Rig,
    pose: &RigPose,
    sweep: Angle,
    matcher: &dyn Matcher,
) -> Result<(Matches, f64), MatchError> {
    let matching = Stopwatch::start();
    let (left, right) = (grayscale(eyes.left), grayscale(eyes.right));
    let pose_sigma = pose.rotation_sigma.rad().hypot(sweep.rad()).max(LEAST_MATCHING_SIGMA.rad());
    let found = matcher.find(&ImagePair {
        left: &left,
        right: &right,
        left_camera: &rig.left_camera,
        right_camera: &rig.right_camera,
        left_from_right: pose.left_from_right,
        pose_sigma: Angle::from_rad(pose_sigma),
        nearest: NEAREST,
    })?;
    Ok((found, matching.seconds()))
}

fn pixel_pairs(found: &Matches) -> Vec<(PixelPair, f64)> {
    found.pairs.iter().map(Match::measured).collect()
}

fn stereo<'a>(rig: &'a Rig, pose: &RigPose) -> StereoPair<'a> {
    StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right }
}

/// Triangulates given correspondences, each with the standard deviation of its positions in pixels.
#[must_use]
pub fn triangulate(pairs: &[(PixelPair, f64)], eyes: Eyes<'_>, rig: &Rig, pose: &RigPose, kernel: Kernel) -> Look {
    let triangulation = Stopwatch::start();
    let stereo = stereo(rig, pose);
    let result = cloud_of_each(pairs, &stereo, &Gates { kernel, ..gates(rig, pose) });
    Look {
        pose_drift: pose_drift(pairs, &stereo, &pose.covariance),
        matches: pairs.len(),
        triangulate_seconds: triangulation.seconds(),
        ..Look::of_cloud(result, eyes)
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
    fn of_cloud(cloud: Cloud, eyes: Eyes<'_>) -> Self {
        let coloured = |point: CloudPoint| {
            let colour = colour_at(eyes.left, point.pixels.left);
            ColouredPoint { point, colour, score: 1.0 }
        };
        Self {
            points: cloud.points.into_iter().map(coloured).collect(),
            dropped: cloud.dropped.into_iter().map(|(reason, count)| (reason.as_str(), count)).collect(),
            ..Self::default()
        }
    }

    /// With what only the matcher knows: scores, and what it dropped itself.
    fn of_matches(mut self, found: &Matches) -> Self {
        for point in &mut self.points {
            point.score = found.pairs.get(point.point.pair_index).map_or(0.0, |found| found.score);
        }
        for (reason, count) in &found.dropped {
            *self.dropped.entry(reason.as_str()).or_default() += count;
        }
        self
    }

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

/// What one camera alone sees: a direction, and no range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// In the camera's own frame.
    pub direction: UnitRay<CameraFrame>,
    /// Standard deviation of the direction, along and across.
    pub sigma: Angle,
    /// Where the image shows it.
    pub pixel: Pixel,
    /// sRGB.
    pub colour: [u8; 3],
}

/// The corners of one image as directions: what is left where the other camera is dead.
#[must_use]
pub fn bearings(image: &RgbImage, lens: &KannalaBrandt) -> Vec<Bearing> {
    let bearing = |pixel: Pixel| {
        let direction = lens.unproject::<CameraFrame>(pixel).ok()?;
        // The coarser of both directions of the picture.
        let by_pixel = lens.ray_by_pixel(&direction);
        let coarser = by_pixel.column(0).norm().max(by_pixel.column(1).norm());
        let sigma = Angle::from_rad(CORNER_SIGMA * coarser);
        Some(Bearing { direction, sigma, pixel, colour: colour_at(image, pixel) })
    };
    image_corners(&grayscale(image), lens, MOST_BEARINGS).into_iter().filter_map(bearing).collect()
}

/// The colour of the pixel nearest to a position, black outside.
#[must_use]
pub fn colour_at(image: &RgbImage, pixel: Pixel) -> [u8; 3] {
    // Positions lie on the sensor, so rounding stays inside; the cast saturates if one ever does not.
    let (x, y) = (pixel.u.round().max(0.0) as u32, pixel.v.round().max(0.0) as u32);
    image.get_pixel_checked(x, y).map_or([0; 3], |colour| colour.0)
}
