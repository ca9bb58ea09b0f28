//! The bench itself: targets 350 mm before the rig, every corner measured by every method and compared with the truth.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_scene::{Lens, Target};
use vergence_vision::{
    KannalaBrandt, Kernel, Left, Length, PixelPair, Point, PointUncertainty, ResidualUncertainty, Right,
    SharedCovariance, StereoPair, Transform, UnitRay, ray_to_plane,
};

use crate::axes::Axes;
use crate::bench::MODES;
use crate::chain::Calibrated;
use crate::drive::Stop;
use crate::eyes::Eyes;
use crate::method::Method;
use crate::own_frame::own_frame;
use crate::pair::{PAIR_VIEWS, Pair};
use crate::target_shot::{FoundCorners, Photo, same_place};
use crate::targets::{Spread, targets};
use crate::undistort::Pinhole;
use crate::undistorted::{InPicture, Undistorted};
use vergence_sim::Random;
use vergence_targets::Corner;

/// From the baseline, as in the paper.
pub const DEPTH: Length = Length::from_mm(350.0);
/// Corners whose rays miss one epipolar plane by so many standard deviations are not one corner.
const GATE_SIGMAS: f64 = 5.0;

/// The targets that are measured in each mode.
const MEASURED: Spread = Spread { targets: 5, depth_mm: [DEPTH.mm(); 2], tilt_rad: 0.25 };

/// One corner by one method.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Index into [`MODES`].
    pub mode: usize,
    /// By which method.
    pub method: Method,
    /// Depth found minus true depth, both from the baseline along the rig's forward direction.
    pub error_mm: f64,
    /// The true depth.
    pub depth_mm: f64,
    /// Between the rig's forward direction and the corner, seen from the middle of the baseline.
    pub field_deg: f64,
    /// Predicted variance of the depth, from pixels and from calibration; only our method states one.
    pub variance_mm2: Option<[f64; 2]>,
}

/// What the bench came to in all modes.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Every corner by every method that has a point there.
    pub samples: Vec<Sample>,
    /// For each mode the square of one random corner's error, by our method, in units of its own covariance.
    pub nees: Vec<Option<f64>>,
    /// How far the corners were from where they truly are, in pixels.
    pub errors_px: Vec<f64>,
    /// Corners seen by both cameras, and those of them that the gate of our method refused.
    pub corners: [usize; 2],
    /// For each mode.
    pub undistorted: Vec<Undistorted>,
}

/// What both cameras have of one target.
struct Seen {
    fisheye: [Option<FoundCorners>; 2],
    undistorted: [Option<InPicture>; 2],
}

/// Measures targets in every mode; `stops` are where the stage stood, and `returns` draws how far it misses them before each
/// target.
pub fn measure(
    eyes: &Eyes<'_>,
    stops: &[Stop],
    calibrated: &Calibrated,
    random: &mut Random,
    returns: &mut Random,
) -> Measured {
    let mut measured = Measured::default();
    for (mode, (stop, pair)) in stops.iter().zip(&calibrated.pairs).enumerate().take(MODES.len()) {
        let targets = targets(&stop.truth, &MEASURED, random);
        let seed = random.seed();
        let standing: Vec<_> = targets.iter().map(|_| eyes.conditions.returned(&stop.truth, returns)).collect();
        let seen: Vec<Seen> = targets
            .par_iter()
            .zip(&standing)
            .enumerate()
            .map(|(index, (target, standing))| {
                Seen::of(&eyes.photographs(standing, target, seed ^ index as u64), calibrated)
            })
            .collect();
        let view = View::new(mode, stop, calibrated, pair, &eyes.lenses[0]);
        let mut squares = Vec::new();
        let mut undistorted = Undistorted { views: [pair.views[1], PAIR_VIEWS], ..Undistorted::default() };
        for (target, seen) in targets.iter().zip(&seen) {
            undistorted.count(&seen.undistorted, &Pinhole::of(&calibrated.own[0]));
            view.rectified(target, seen, &mut measured);
            let [Some(left), Some(right)] = &seen.fisheye else { continue };
            measured.errors_px.extend(left.errors_px.iter().chain(&right.errors_px));
            if left.labelled && right.labelled {
                view.score(target, [left, right], &mut measured, &mut squares);
            }
        }
        // One of each: the corners of a seed share their calibration and err together.
        let pick = (random.between(0.0, squares.len() as f64) as usize).min(squares.len().saturating_sub(1));
        measured.nees.push(squares.get(pick).copied());
        measured.undistorted.push(undistorted);
    }
    measured
}

impl Seen {
    fn of(photos: &[Option<Photo>; 2], calibrated: &Calibrated) -> Self {
        let known = [&calibrated.stage.left, &calibrated.stage.right];
        let undistorted = |side: usize| {
            let (photo, pinhole) = (photos[side].as_ref()?, Pinhole::of(&calibrated.own[side]));
            Some(InPicture { truth: photo.undistorted_truth(&pinhole), found: photo.undistorted(&pinhole) })
        };
        Self {
            fisheye: [0, 1].map(|side| photos[side].as_ref()?.found(Some(known[side]))),
            undistorted: [0, 1].map(undistorted),
        }
    }
}

/// A mode as the calibrations know it, and as it is.
struct View<'a> {
    mode: usize,
    /// Of our method.
    ours: StereoPair<'a>,
    shared: SharedCovariance,
    unit_sigma_px: f64,
    own: &'a [KannalaBrandt; 2],
    pair: &'a Pair,
    truth: Axes,
    /// How the left camera's own frame is turned against its true one, as the stage's calibration found it and as its own calibration did.
    turns: [UnitQuaternion<f64>; 2],
}

/// A corner that both cameras see.
struct Match {
    pixels: PixelPair,
    /// Of their coordinates, root mean square over both cameras.
    sigma_px: f64,
}

impl<'a> View<'a> {
    fn new(mode: usize, stop: &Stop, calibrated: &'a Calibrated, pair: &'a Pair, left: &dyn Lens) -> Self {
        let Calibrated { stage, rig, own, .. } = calibrated;
        let values: Vec<f64> = stop.readings.iter().map(|reading| reading.value()).collect();
        let pose = rig.pose_read_at(&values);
        Self {
            mode,
            ours: StereoPair {
                left: &rig.left_camera,
                right: &rig.right_camera,
                left_from_right: pose.left_from_right,
            },
            shared: pose.shared,
            unit_sigma_px: stage.unit_sigma_px,
            own,
            pair,
            truth: Axes::of(&stop.truth),
            turns: [&rig.left_camera, &own[0]].map(|found| own_frame(found, left)),
        }
    }

    /// Every corner of a target that both undistorted pictures show.
    fn rectified(&self, target: &Transform<Left, Target>, seen: &Seen, measured: &mut Measured) {
        let Some(pair) = &self.pair.pinholes else { return };
        let [Some(left), Some(right)] = seen.undistorted.each_ref().map(|seen| seen.as_ref()?.labelled()) else {
            return;
        };
        measured.samples.extend(twins(left, right).filter_map(|(left, right)| {
            let point = pair.point([left.pixel, right.pixel])?;
            Some(self.sample(Method::Rectified, &point, &(*target * on_target(left)), None))
        }));
    }

    /// Every corner of a target that both fisheye pictures show.
    fn score(
        &self,
        target: &Transform<Left, Target>,
        seen: [&FoundCorners; 2],
        measured: &mut Measured,
        squares: &mut Vec<f64>,
    ) {
        for (left, right) in twins(seen[0], seen[1]) {
            measured.corners[0] += 1;
            let found = Match {
                pixels: PixelPair { left: left.pixel, right: right.pixel },
                sigma_px: self.unit_sigma_px * rms(left.relative_sigma, right.relative_sigma),
            };
            let truth = *target * on_target(left);
            measured.samples.extend(self.by_pair(&found.pixels, &truth));
            if self.is_one_corner(&found) {
                measured.samples.extend(self.by_ours(&found, &truth));
                squares.extend(self.square(&found, &truth));
            } else {
                measured.corners[1] += 1;
            }
        }
    }

    /// By the pair that was calibrated at this pose.
    fn by_pair(&self, pixels: &PixelPair, truth: &Point<Left>) -> Vec<Sample> {
        let Some(left_from_right) = self.pair.bundles else { return Vec::new() };
        let pair = StereoPair { left: &self.own[0], right: &self.own[1], left_from_right };
        let methods = [(Method::Midpoint, Kernel::Midpoint), (Method::PseudoIntersection, Kernel::PseudoIntersection)];
        let sample = |(method, kernel): &(Method, Kernel)| {
            let point = kernel.triangulate(pixels, &pair).ok()?.point;
            Some(self.sample(*method, &point, truth, None))
        };
        methods.iter().filter_map(sample).collect()
    }

    fn by_ours(&self, Match { pixels, sigma_px }: &Match, truth: &Point<Left>) -> Option<Sample> {
        let point = Kernel::PseudoIntersection.triangulate(pixels, &self.ours).ok()?.point;
        let uncertain = PointUncertainty::of(&point, &self.ours, *sigma_px)?;
        let forward = self.turns[0] * self.truth.forward;
        let along = |covariance: nalgebra::Matrix3<f64>| (forward.transpose() * covariance * forward).x;
        let variance = [along(uncertain.from_pixels), along(uncertain.covariance_with(&uncertain, &self.shared))];
        Some(self.sample(Method::Ours, &point, truth, Some(variance)))
    }

    /// Whether both rays lie in one epipolar plane, as far as that is certain.
    fn is_one_corner(&self, Match { pixels, sigma_px }: &Match) -> bool {
        let residual = || {
            let left: UnitRay<Left> = self.ours.left.unproject(pixels.left).ok()?;
            let right: UnitRay<Right> = self.ours.right.unproject(pixels.right).ok()?;
            let sigma = ResidualUncertainty::of(&left, &right, &self.ours, *sigma_px)?.sigma(&self.shared);
            let angle = ray_to_plane(&left, &(self.ours.left_from_right * right), &self.ours.left_from_right.origin())?;
            Some(angle.rad().abs() <= GATE_SIGMAS * sigma.rad())
        };
        residual().unwrap_or(false)
    }

    fn sample(
        &self,
        method: Method,
        point: &Point<Left>,
        truth: &Point<Left>,
        variance_mm2: Option<[f64; 2]>,
    ) -> Sample {
        let forward = self.truth.forward;
        let from_middle = truth.mm() - self.truth.middle;
        let turn = self.turns[if method == Method::Ours { 0 } else { 1 }];
        Sample {
            mode: self.mode,
            method,
            error_mm: (point.mm() - turn * truth.mm()).dot(&(turn * forward)),
            depth_mm: from_middle.dot(&forward),
            field_deg: from_middle.angle(&forward).to_degrees(),
            variance_mm2,
        }
    }

    /// The square of our point's error in units of its covariance.
    fn square(&self, Match { pixels, sigma_px }: &Match, truth: &Point<Left>) -> Option<f64> {
        let point = Kernel::PseudoIntersection.triangulate(pixels, &self.ours).ok()?.point;
        let covariance = PointUncertainty::of(&point, &self.ours, *sigma_px)?.covariance(&self.shared);
        let error = point.mm() - self.turns[0] * truth.mm();
        Some(error.dot(&covariance.cholesky()?.solve(&error)))
    }
}

/// The corners that both have.
fn twins<'a>(left: &'a FoundCorners, right: &'a FoundCorners) -> impl Iterator<Item = (&'a Corner, &'a Corner)> {
    left.view
        .corners
        .iter()
        .filter_map(|left| Some((left, right.view.corners.iter().find(|right| same_place(left, right))?)))
}

fn rms(a: f64, b: f64) -> f64 {
    a.hypot(b) / std::f64::consts::SQRT_2
}

fn on_target(corner: &Corner) -> Point<Target> {
    Point::from_mm(Vector3::new(corner.target_mm[0], corner.target_mm[1], 0.0))
}
