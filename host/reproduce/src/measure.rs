//! The bench itself: targets 350 mm before the rig, every corner triangulated by every method and compared with the
//! truth.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_scene::Target;
use vergence_vision::{
    Kernel, Left, Length, PixelPair, Point, PointUncertainty, ResidualUncertainty, Right, SharedCovariance, StereoPair,
    Transform, UnitRay, ray_to_plane,
};

use crate::axes::Axes;
use crate::bench::{Bench, MODES, scene_target};
use crate::chain::{Calibrated, both};
use crate::drive::Stop;
use crate::target_shot::{CornerSource, FoundCorners, same_place};
use vergence_sim::Random;
use vergence_targets::Corner;

/// The methods that stand side by side: of the rectified pair, the midpoint, and ours.
pub const METHODS: [Kernel; 3] = [Kernel::Rectified, Kernel::Midpoint, Kernel::PseudoIntersection];
/// From the baseline, as in the paper.
pub const DEPTH: Length = Length::from_mm(350.0);
/// Targets before the rig in each mode: one straight ahead, the others towards the corners of the field.
const TARGETS: u64 = 5;
/// Centres of those lie within so many degrees of straight ahead, to the side and up or down.
const ASIDE_DEG: [f64; 2] = [10.0, 22.0];
/// Targets are tilted up to so far about two axes.
const TILT_RAD: f64 = 0.25;
/// Corners whose rays miss one epipolar plane by so many standard deviations are not one corner.
const GATE_SIGMAS: f64 = 5.0;

/// One corner by one method.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Index into [`MODES`].
    pub mode: usize,
    /// Index into [`METHODS`].
    pub method: usize,
    /// Depth found minus true depth, both from the baseline along the rig's forward direction.
    pub error_mm: f64,
    /// The true depth.
    pub depth_mm: f64,
    /// Between the rig's forward direction and the corner, seen from the middle of the baseline.
    pub field_deg: f64,
    /// Predicted variance of the depth, from pixels and from calibration.
    pub variance_mm2: [f64; 2],
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
    /// Corners seen by both cameras, and those of them that the gate refused.
    pub corners: [usize; 2],
}

/// Measures targets in every mode; `stops` are where the stage stood.
pub fn measure(
    bench: &Bench,
    stops: &[Stop],
    calibrated: &Calibrated,
    corner_source: &CornerSource,
    random: &mut Random,
) -> Measured {
    let mut measured = Measured::default();
    let known = [&calibrated.stage.left, &calibrated.stage.right];
    for (mode, stop) in stops.iter().enumerate().take(MODES.len()) {
        let targets = targets(&stop.truth, random);
        let seed = random.seed();
        let seen: Vec<[Option<FoundCorners>; 2]> = targets
            .par_iter()
            .enumerate()
            .map(|(index, target)| both(bench, &stop.truth, target, known, corner_source, seed ^ index as u64))
            .collect();
        let view = View::new(mode, stop, calibrated);
        let mut squares = Vec::new();
        for (target, seen) in targets.iter().zip(&seen) {
            let [Some(left), Some(right)] = seen else { continue };
            measured.errors_px.extend(left.errors_px.iter().chain(&right.errors_px));
            if left.labelled && right.labelled {
                view.score(target, [left, right], &mut measured, &mut squares);
            }
        }
        // One of each: the corners of a seed share their calibration and err together.
        let pick = (random.between(0.0, squares.len() as f64) as usize).min(squares.len().saturating_sub(1));
        measured.nees.push(squares.get(pick).copied());
    }
    measured
}

/// Targets at the bench's depth, in the left frame.
fn targets(left_from_right: &Transform<Left, Right>, random: &mut Random) -> Vec<Transform<Left, Target>> {
    let axes = Axes::of(left_from_right);
    (0..TARGETS)
        .map(|index| {
            let mut aside = |sign: f64| sign * random.between(ASIDE_DEG[0], ASIDE_DEG[1]).to_radians().tan();
            // The four quarters of the field, one after the other.
            let (x, y) = match index {
                0 => (0.0, 0.0),
                quarter => {
                    (aside(if quarter % 2 == 0 { 1.0 } else { -1.0 }), aside(if quarter > 2 { 1.0 } else { -1.0 }))
                }
            };
            let centre = axes.middle + (axes.forward + axes.right * x + axes.down * y) * DEPTH.mm();
            let tilt = UnitQuaternion::from_euler_angles(
                random.between(-TILT_RAD, TILT_RAD),
                random.between(-TILT_RAD, TILT_RAD),
                random.between(-TILT_RAD, TILT_RAD),
            );
            scene_target().placed(axes.rotation() * tilt, centre)
        })
        .collect()
}

/// A mode as the calibrated rig knows it, and as it is.
struct View<'a> {
    mode: usize,
    pair: StereoPair<'a>,
    shared: SharedCovariance,
    unit_sigma_px: f64,
    truth: Axes,
}

/// A corner that both cameras see.
struct Match {
    pixels: PixelPair,
    /// Of their coordinates, root mean square over both cameras.
    sigma_px: f64,
}

impl<'a> View<'a> {
    fn new(mode: usize, stop: &Stop, calibrated: &'a Calibrated) -> Self {
        let Calibrated { stage, rig, .. } = calibrated;
        let values: Vec<f64> = stop.readings.iter().map(|reading| reading.value()).collect();
        let pose = rig.pose_read_at(&values);
        Self {
            mode,
            pair: StereoPair {
                left: &rig.left_camera,
                right: &rig.right_camera,
                left_from_right: pose.left_from_right,
            },
            shared: pose.shared,
            unit_sigma_px: stage.unit_sigma_px,
            truth: Axes::of(&stop.truth),
        }
    }

    /// Every corner of a target that both cameras see.
    fn score(
        &self,
        target: &Transform<Left, Target>,
        seen: [&FoundCorners; 2],
        measured: &mut Measured,
        squares: &mut Vec<f64>,
    ) {
        for left in &seen[0].view.corners {
            let Some(right) = seen[1].view.corners.iter().find(|right| same_place(left, right)) else { continue };
            measured.corners[0] += 1;
            let found = Match {
                pixels: PixelPair { left: left.pixel, right: right.pixel },
                sigma_px: self.unit_sigma_px * rms(left.relative_sigma, right.relative_sigma),
            };
            if !self.is_one_corner(&found) {
                measured.corners[1] += 1;
                continue;
            }
            let truth = *target * on_target(left);
            measured.samples.extend(METHODS.iter().enumerate().filter_map(|(method, kernel)| {
                let point = kernel.triangulate(&found.pixels, &self.pair).ok()?.point;
                self.sample(method, &point, found.sigma_px, &truth)
            }));
            squares.extend(self.square(&found, &truth));
        }
    }

    /// Whether both rays lie in one epipolar plane, as far as that is certain.
    fn is_one_corner(&self, Match { pixels, sigma_px }: &Match) -> bool {
        let residual = || {
            let left: UnitRay<Left> = self.pair.left.unproject(pixels.left).ok()?;
            let right: UnitRay<Right> = self.pair.right.unproject(pixels.right).ok()?;
            let sigma = ResidualUncertainty::of(&left, &right, &self.pair, *sigma_px)?.sigma(&self.shared);
            let angle = ray_to_plane(&left, &(self.pair.left_from_right * right), &self.pair.left_from_right.origin())?;
            Some(angle.rad().abs() <= GATE_SIGMAS * sigma.rad())
        };
        residual().unwrap_or(false)
    }

    fn sample(&self, method: usize, point: &Point<Left>, sigma_px: f64, truth: &Point<Left>) -> Option<Sample> {
        let uncertain = PointUncertainty::of(point, &self.pair, sigma_px)?;
        let forward = self.truth.forward;
        let along = |covariance: nalgebra::Matrix3<f64>| (forward.transpose() * covariance * forward).x;
        let from_middle = truth.mm() - self.truth.middle;
        Some(Sample {
            mode: self.mode,
            method,
            error_mm: (point.mm() - truth.mm()).dot(&forward),
            depth_mm: from_middle.dot(&forward),
            field_deg: from_middle.angle(&forward).to_degrees(),
            variance_mm2: [along(uncertain.from_pixels), along(uncertain.covariance_with(&uncertain, &self.shared))],
        })
    }

    /// The square of our point's error in units of its covariance.
    fn square(&self, Match { pixels, sigma_px }: &Match, truth: &Point<Left>) -> Option<f64> {
        let point = Kernel::PseudoIntersection.triangulate(pixels, &self.pair).ok()?.point;
        let covariance = PointUncertainty::of(&point, &self.pair, *sigma_px)?.covariance(&self.shared);
        let error = point.mm() - truth.mm();
        Some(error.dot(&covariance.cholesky()?.solve(&error)))
    }
}

fn rms(a: f64, b: f64) -> f64 {
    a.hypot(b) / std::f64::consts::SQRT_2
}

fn on_target(corner: &Corner) -> Point<Target> {
    Point::from_mm(Vector3::new(corner.target_mm[0], corner.target_mm[1], 0.0))
}
