//! One rig with one mismatch, calibrated from projected corners and measured by its file at known points.

use std::f64::consts::PI;

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_calibration::LensModel;
use vergence_lens::BuiltIn;
use vergence_output::{PoseSource, drift_warning};
use vergence_pipeline::{PairCloud, PairPose, cloud_of_pairs};
use vergence_rig::Rig;
use vergence_scene::Lens;
use vergence_sim::Random;
use vergence_vision::{Kernel, Left, Pixel, PixelPair, Point, Side};

use super::world::World;
use super::{Mismatch, RANGES_MM};
use crate::axes::Axes;
use crate::bench::MODES;
use crate::chain::calibrate;
use crate::conditions::{Conditions, NOISE_PX};
use crate::drive::{Drive, Standing};
use crate::error::ReproduceError;
use crate::eyes::Eyes;
use crate::own_frame::own_frame;
use crate::target_shot::Corners;

/// Points at each range of each mode.
pub const POINTS: usize = 30;
/// They lie within so much of straight ahead, in parts of their depth, to the side and up or down.
const ASIDE: f64 = 0.35;
/// Matches all over the shared field, in the cloud that tells of warnings.
const MATCHES: usize = 400;
/// Places tried for each point until both cameras see it.
const TRIES: usize = 100;

/// A point that was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Index into [`MODES`].
    pub mode: usize,
    /// Index into [`RANGES_MM`].
    pub range: usize,
    /// Depth found minus true depth, along the rig's forward direction.
    pub error_mm: f64,
    /// Standard deviation of the depth as the rig states it.
    pub sigma_mm: f64,
    /// Square of the error of the point in units of its stated covariance.
    pub square: f64,
}

/// What one rig came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What was wrong.
    pub mismatch: Mismatch,
    /// How its lenses were calibrated.
    pub model: LensModel,
    /// The points.
    pub sightings: Vec<Sighting>,
    /// Points that both cameras saw, for each mode.
    pub seen: [usize; MODES.len()],
    /// Whether a cloud in each mode of matches all over the shared field came with a warning that images disagree with the lenses or the encoders.
    pub warned: [bool; MODES.len()],
    /// Standard deviation of a corner as the calibration finds it, in pixels.
    pub corner_px: f64,
}

/// A point before the rig and what the cameras show of it.
struct Shown {
    range: usize,
    truth: Point<Left>,
    pixels: PixelPair,
}

impl Trial {
    /// The rig of a seed with this mismatch, its lenses calibrated with this model. The noise does not depend on the model.
    ///
    /// # Errors
    /// Where the bench cannot be built or calibrated, or the design cannot be traced.
    pub fn of(mismatch: Mismatch, lens: BuiltIn, model: LensModel, seed: u64) -> Result<Self, ReproduceError> {
        let world = World::new(mismatch, lens, seed)?;
        let [mut random, mut returns, mut matches, mut all_over] =
            [seed, !seed, seed ^ 0x706f_696e_7473, seed ^ 0x616c_6c6f].map(Random::new);
        let drive = Drive { calibration: world.calibration_stops(&mut random), modes: Vec::new() };
        // The lenses are the world's own, of whatever kind conditions name.
        let conditions = Conditions { bow: world.bow, ..Conditions::noise(Corners::Projected, NOISE_PX) };
        let eyes = Eyes { lenses: world.calibrating.clone(), conditions: &conditions };
        let calibrated = calibrate(&world.bench, &drive, &eyes, model, &mut random, &mut returns)?;
        let mut trial = Self {
            mismatch,
            model,
            sightings: Vec::new(),
            seen: [0; MODES.len()],
            warned: [false; MODES.len()],
            corner_px: calibrated.stage.sigma_px,
        };
        for (mode, name) in MODES.iter().enumerate() {
            let Some(targets) = world.bench.drawn.mode(name).map(|mode| &mode.targets) else { continue };
            let standing = world.stand(targets, &mut matches);
            let shown = world.shown(&standing, &mut matches);
            let cloud = world.measured(&standing, &shown, &calibrated.rig)?;
            trial.seen[mode] = shown.len();
            let wide = world.measured(&standing, &world.all_over(&standing, &mut all_over), &calibrated.rig)?;
            trial.warned[mode] = drift_warning(&wide, PoseSource::Encoders).is_some();
            let turn = own_frame(&calibrated.rig.left_camera, &world.measuring[0]);
            let forward = Axes::of(&world.pose(&standing, 0.0).left_from_right).forward;
            trial.sightings.extend(sightings(mode, &shown, &cloud, &(turn, turn * forward)));
        }
        Ok(trial)
    }
}

impl World {
    /// Points at every range, matched with noise.
    fn shown(&self, standing: &Standing, random: &mut Random) -> Vec<Shown> {
        let axes = Axes::of(&self.pose(standing, 0.0).left_from_right);
        let mut shown = Vec::new();
        for (range, depth) in RANGES_MM.iter().enumerate() {
            let one = |random: &mut Random| {
                (0..TRIES).find_map(|_| {
                    let mut aside = || random.between(-ASIDE, ASIDE);
                    let towards = axes.forward + axes.right * aside() + axes.down * aside();
                    let truth = Point::<Left>::from_mm(axes.middle + towards * *depth);
                    let pixels = PixelPair {
                        left: self.image_of(standing, Side::Left, &truth)?,
                        right: self.image_of(standing, Side::Right, &truth)?,
                    };
                    Some(Shown { range, truth, pixels })
                })
            };
            for _ in 0..POINTS {
                let Some(point) = one(random) else { continue };
                let mut noisy =
                    |at: Pixel| Pixel { u: at.u + NOISE_PX * random.normal(), v: at.v + NOISE_PX * random.normal() };
                let pixels = PixelPair { left: noisy(point.pixels.left), right: noisy(point.pixels.right) };
                shown.push(Shown { pixels, ..point });
            }
        }
        shown
    }

    /// Points all over the field that both cameras share, at any distance between the nearest and the farthest range, matched with noise.
    fn all_over(&self, standing: &Standing, random: &mut Random) -> Vec<Shown> {
        let [nearest, .., farthest] = RANGES_MM;
        let one = |random: &mut Random| {
            let towards = Vector3::new(random.normal(), random.normal(), random.normal()).normalize();
            let truth = Point::<Left>::from_mm(towards * nearest * (farthest / nearest).powf(random.between(0.0, 1.0)));
            let [left, right] = [Side::Left, Side::Right].map(|side| self.image_of(standing, side, &truth));
            let mut noisy =
                |at: Pixel| Pixel { u: at.u + NOISE_PX * random.normal(), v: at.v + NOISE_PX * random.normal() };
            let pixels = PixelPair { left: noisy(left?), right: noisy(right?) };
            Some(Shown { range: 0, truth, pixels })
        };
        (0..TRIES * MATCHES).filter_map(|_| one(random)).take(MATCHES).collect()
    }

    /// Where a camera shows a point of the left frame at the middle row of the left image, at the exposure of the row on which it shows it;
    /// `None` beside the sensor.
    fn image_of(&self, standing: &Standing, side: Side, point: &Point<Left>) -> Option<Pixel> {
        /// The image moves by some pixels while it is exposed, and by a thousandth of that with each step of the search.
        const STEPS: usize = 5;
        let lens = &self.measuring[side.index()];
        let in_base = self.pose(standing, 0.0).base_from_left * *point;
        let mut seconds = 0.0;
        let mut pixel = None;
        for _ in 0..STEPS {
            let pose = self.pose(standing, seconds);
            let in_left = pose.base_from_left.inverse() * in_base;
            let at = match side {
                Side::Left => lens.image_of(&Point::from_mm(in_left.mm()))?,
                Side::Right => lens.image_of(&Point::from_mm((pose.left_from_right.inverse() * in_left).mm()))?,
            };
            seconds = self.seconds_at_row(at.v, side.index());
            pixel = Some(at);
        }
        pixel.filter(|at| lens.size().contains(*at))
    }

    /// The cloud of these matches, by the file of the calibrated rig.
    fn measured(&self, standing: &Standing, shown: &[Shown], file: &Rig) -> Result<PairCloud, ReproduceError> {
        let pairs: Vec<_> = shown.iter().map(|shown| (shown.pixels, NOISE_PX)).collect();
        let unknown = |error: vergence_rig::TrackGap| ReproduceError::Rig(error.to_string());
        let pose = if self.speeds.iter().all(|speed| *speed == 0.0) {
            let read: Vec<f64> = standing.readings.iter().map(|reading| reading.value()).collect();
            PairPose::standing(file.pose_read_at(&read))
        } else {
            PairPose::at_speed(file, &standing.readings, &self.speeds).map_err(unknown)?
        };
        cloud_of_pairs(&pairs, &RgbImage::new(1, 1), file, &pose, Kernel::default()).map_err(unknown)
    }
}

/// The points of a cloud beside the truth, in the calibrated frame of the left lens, which is turned against the true one.
fn sightings<'a>(
    mode: usize,
    shown: &'a [Shown],
    cloud: &'a PairCloud,
    (turn, forward): &'a (UnitQuaternion<f64>, Vector3<f64>),
) -> impl Iterator<Item = Sighting> + 'a {
    cloud.points.iter().filter_map(move |found| {
        let (found, shown) = (&found.point, shown.get(found.point.pair_index)?);
        let error = found.point.mm() - turn * shown.truth.mm();
        Some(Sighting {
            mode,
            range: shown.range,
            error_mm: error.dot(forward),
            sigma_mm: forward.dot(&(found.covariance * forward)).sqrt(),
            square: error.dot(&found.covariance.cholesky()?.solve(&error)),
        })
    })
}

/// The mean absolute error of normal errors with this standard deviation.
pub fn mean_absolute(sigma: f64) -> f64 {
    (2.0 / PI).sqrt() * sigma
}
