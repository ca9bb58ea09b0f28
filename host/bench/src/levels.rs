//! What richer lenses cost in use: points of matched pixels with their covariance, and the calibration of a lens.

use std::hint::black_box;

use nalgebra::{Isometry3, Point3, SMatrix, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use vergence_calibration::{IntrinsicsOptions, LensModel, LensParameters, calibrate_intrinsics, reproject};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{
    Angle, Camera, Gates, ImageSize, KannalaBrandt, LENS_PARAMETERS, Left, Pixel, PixelPair, Point, Right,
    SHARED_PARAMETERS, SharedCovariance, StereoPair, Transform, cloud,
};

use crate::error::BenchError;
use crate::lenses::ratio_in_words;
use crate::{Clock, timed};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
const FIELD: Angle = Angle::from_deg(98.0);
/// f, c, k, e0 and e1, decentring, thin prism: about those of a mounted Sigma lens. A lower level has the first of them.
const LENS: [f64; LENS_PARAMETERS] = [
    599.1, 600.2, 1021.0, 1027.5, -0.052, 0.0041, -0.0019, 0.0002, 2.8, 0.7, 4e-4, -3e-4, 5e-4, -1e-4, -4e-4, 2e-4,
    0.0, 0.0, 5e-5, -3e-5,
];
/// Standard deviations of these.
const SIGMAS: [f64; LENS_PARAMETERS] = [
    0.05, 0.05, 0.04, 0.04, 2e-4, 3e-4, 2e-4, 5e-5, 0.05, 0.05, 2e-5, 2e-5, 5e-5, 5e-5, 5e-5, 5e-5, 0.0, 0.0, 1e-5,
    1e-5,
];
const POSE_SIGMAS: [f64; 6] = [1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2];
/// A level may take so many times as long as one centre.
const LIMIT: f64 = 1.5;
const POINTS: u32 = 2000;
const VIEWS: u32 = 20;

/// Times by one kind of lens, the least of all runs.
#[derive(Clone, Copy, Debug)]
pub struct LevelTimes {
    /// Which lens.
    pub model: LensModel,
    /// Nanoseconds for a point of two matched pixels, with its covariance by pixels, lenses and pose.
    pub point_ns: f64,
    /// Seconds to calibrate the lens.
    pub solve_s: f64,
    /// The same over those of a lens with one centre.
    pub ratios: [f64; 2],
}

impl LevelTimes {
    /// Times for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let ratio = |ratio| ratio_in_words(ratio, LIMIT);
        format!(
            "points with covariance {:.0} ns ({}), calibration {:.1} ms ({}) times one centre, {LIMIT} allowed",
            self.point_ns,
            ratio(self.ratios[0]),
            1e3 * self.solve_s,
            ratio(self.ratios[1])
        )
    }

    pub(crate) fn json(&self) -> Value {
        let [point_ratio, solve_ratio] = self.ratios;
        json!({
            "model": self.model.to_string(),
            "point_ns": self.point_ns,
            "solve_s": self.solve_s,
            "point_ratio": point_ratio,
            "solve_ratio": solve_ratio,
            "largest_ratio": LIMIT,
        })
    }
}

/// Measures every level, `repeats` times in turn.
pub(crate) fn levels(repeats: u32, clock: Clock) -> Result<Vec<LevelTimes>, BenchError> {
    let kinds = [(LensModel::Central, 8), (LensModel::MovingPupil, 9), (LensModel::Full, LENS_PARAMETERS)];
    let levels = kinds.map(|(model, parameters)| Level::of(model, parameters));
    let levels = levels.into_iter().collect::<Result<Vec<_>, _>>()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| BenchError::Threads(error.to_string()))?;
    let mut least = vec![[f64::INFINITY; 2]; levels.len()];
    for _ in 0..repeats {
        for (level, least) in levels.iter().zip(&mut least) {
            let (kept, seconds) = timed(clock, || black_box(level.points()));
            let (solved, taken) = timed(clock, || pool.install(|| level.solve()));
            solved?;
            *least = [least[0].min(seconds * 1e9 / kept.max(1) as f64), least[1].min(taken)];
        }
    }
    let central = least.first().copied().unwrap_or([f64::NAN; 2]);
    let times = |(level, [point_ns, solve_s]): (&Level, &[f64; 2])| LevelTimes {
        model: level.model,
        point_ns: *point_ns,
        solve_s: *solve_s,
        ratios: [point_ns / central[0], solve_s / central[1]],
    };
    Ok(levels.iter().zip(&least).map(times).collect())
}

/// A lens with what is measured of it.
struct Level {
    model: LensModel,
    lens: KannalaBrandt,
    left_from_right: Transform<Left, Right>,
    matches: Vec<PixelPair>,
    gates: Gates,
    views: Vec<TargetView>,
}

impl Level {
    fn of(model: LensModel, parameters: usize) -> Result<Self, BenchError> {
        let only = |all: [f64; LENS_PARAMETERS]| {
            let mut kept = [0.0; LENS_PARAMETERS];
            kept[..parameters].copy_from_slice(&all[..parameters]);
            kept
        };
        let numbers = LensParameters::from_array(only(LENS));
        let lens = numbers.camera(FIELD, SIZE);
        let lens = lens.map_err(|error| BenchError::Work(format!("a lens of the measurement: {error}")))?;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 60f64.to_radians());
        let left_from_right = Transform::new(turn, Vector3::new(125.0, 0.0, 72.0));
        let mut level = Self {
            model,
            lens,
            left_from_right,
            matches: Vec::new(),
            gates: Gates { shared: shared(&only(SIGMAS)), ..Gates::default() },
            views: (0..VIEWS).map(|view| self::view(numbers, view)).collect(),
        };
        level.matches = (0..POINTS).filter_map(|index| level.matched(index)).collect();
        Ok(level)
    }

    /// The pixels of a point 0.3 to 1.3 m away, between both axes.
    fn matched(&self, index: u32) -> Option<PixelPair> {
        let (a, b) = (0.5 + 0.5 * spread(index, 0) - 0.25, spread(index, 1) - 0.5);
        let range = 300.0 + 1000.0 * spread(index, 2);
        let towards = Vector3::new(a.sin() * b.cos(), b.sin(), a.cos() * b.cos());
        let point = Point::<Left>::from_mm(towards * range);
        let right = self.lens.project_point(&(self.left_from_right.inverse() * point)).ok()?;
        Some(PixelPair { left: self.lens.project_point(&point).ok()?, right })
    }

    /// How many points there are.
    fn points(&self) -> usize {
        let pair = StereoPair { left: &self.lens, right: &self.lens, left_from_right: self.left_from_right };
        black_box(cloud(black_box(&self.matches), &pair, &self.gates)).points.len()
    }

    fn solve(&self) -> Result<(), BenchError> {
        let options = IntrinsicsOptions { model: self.model, ..IntrinsicsOptions::default() };
        let solved = calibrate_intrinsics(black_box(&self.views), SIZE, &options);
        black_box(solved).map(|_| ()).map_err(|error| BenchError::Work(error.to_string()))
    }
}

/// A covariance of both lenses and the pose.
fn shared(lens: &[f64; LENS_PARAMETERS]) -> SharedCovariance {
    let sigmas: Vec<f64> = [&lens[..], lens, &POSE_SIGMAS].concat();
    SharedCovariance::joint(SMatrix::<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>::from_fn(|row, column| {
        if row == column { sigmas[row] * sigmas[row] } else { 0.0 }
    }))
}

/// Numbers spread evenly from 0 to 1, other ones for each `which` (M. Roberts' sequences: powers of the root of x⁶ = x + 1).
fn spread(index: u32, which: i32) -> f64 {
    const ROOT: f64 = 1.134_724_138_401_519_5;
    (0.5 + f64::from(index + 1) / ROOT.powi(which + 1)).fract()
}

/// A target of 9 x 6 corners 150 to 400 mm away, up to 85° from the axis, tilted, with errors of about 0.1 px.
fn view(lens: LensParameters, index: u32) -> TargetView {
    let (theta, phi) = (1.48 * spread(index, 0).sqrt(), std::f64::consts::TAU * spread(index, 1));
    let towards = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
    let tilt =
        UnitQuaternion::from_euler_angles(spread(index, 2) - 0.5, spread(index, 3) - 0.5, 6.0 * spread(index, 4) - 3.0);
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards).unwrap_or_default() * tilt;
    let pose = Isometry3::from_parts(Translation3::from(towards * (150.0 + 250.0 * spread(index, 5))), facing);
    let corner = |at: u32| {
        let target_mm = [25.0 * f64::from(at % 9) - 100.0, 25.0 * f64::from(at / 9) - 62.5];
        let point = Point::<Camera>::from_mm((pose * Point3::new(target_mm[0], target_mm[1], 0.0)).coords);
        let seen = reproject(lens, &point)?.pixel;
        let error = |which: i32| 0.35 * (spread(1000 + 54 * index + at, which) - 0.5);
        let pixel = Pixel { u: seen[0] + error(0), v: seen[1] + error(1) };
        (point.direction()?.angle_to_axis() < FIELD).then_some(Corner::new(target_mm, pixel))
    };
    TargetView { name: format!("view {index}"), corners: (0..54).filter_map(corner).collect() }
}
