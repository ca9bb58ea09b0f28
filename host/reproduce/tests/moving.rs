//! Measurement while the simulated stages move at full speed, with rolling shutters and uncertain exposure instants,
//! against the same points measured from a standing rig.

#![allow(clippy::expect_used, reason = "a test fails loudly")]
#![allow(clippy::print_stdout, reason = "tests show their figures")]

use nalgebra::Vector3;
use vergence_control::StepSchedule;
use vergence_plant::{AxisPlant, bench_mechanics, bench_settings};
use vergence_protocol::{AxisList, Counts, Microseconds};
use vergence_reproduce::study::Gaussian;
use vergence_rig::{
    BENCH_TOML, BoardInstant, Exposure, JointSample, JointTrack, Joints, PairExposure, Rig, RigCalibration, Shutter,
    moving_cloud,
};
use vergence_vision::{Base, Frame, Gates, KannalaBrandt, Left, Pixel, PixelPair, Point, Transform};

const PIXEL_SIGMA: f64 = 0.05;
const TICK_US: u64 = 100;
const READING_US: u64 = 5_000;
/// A rolling shutter that reads 1280 rows in 19.2 ms.
const LINE_US: f64 = 15.0;
/// Error bound of the instant of an exposure, in microseconds.
const CLOCK_ERROR_US: f64 = 250.0;
/// Poses at the ends of the ranges, in micrometres and microradians.
const FROM: [f64; 2] = [90_000.0, 300_000.0];
const TO: [f64; 2] = [200_000.0, 1_800_000.0];

/// The bench with an exact calibration: only pixels, encoders and the clock have errors.
fn bench() -> Rig {
    let mut rig = Rig::from_toml(BENCH_TOML).expect("the bench is a rig");
    rig.calibration = RigCalibration::exact();
    rig
}

/// A run of both stages: their true motion and the encoder readings.
struct Run {
    /// True positions at every tick, in micrometres and microradians.
    loads: Vec<[f64; 2]>,
    track: JointTrack,
}

/// Moves both stages from `from` to `to` at full speed, with a trapezoid of speed; with `to` = `from` they stand.
fn run(from: [f64; 2], to: [f64; 2]) -> Run {
    let (settings, mechanics) = (bench_settings(), bench_mechanics());
    let mut axes = [0, 1].map(|i| AxisPlant::new(mechanics[i], from[i]));
    let first = [0, 1].map(|i| counts_at(i, from[i]));
    let mut run = Run { loads: Vec::new(), track: JointTrack::new(10_000) };
    for tick in 0..25_000 {
        let now = Microseconds(tick * TICK_US);
        run.loads.push([axes[0].load(), axes[1].load()]);
        if now.0.is_multiple_of(READING_US) {
            let counts = [0, 1].map(|i| Counts(axes[i].encoder() + first[i]));
            run.track.push(JointSample { at: now, counts: counts.into_iter().collect::<AxisList<_>>() });
        }
        for (i, axis) in axes.iter_mut().enumerate() {
            let settings = &settings[i];
            let seconds = (now.0 + TICK_US) as f64 * 1e-6;
            let moved = trapezoid(
                seconds,
                (to[i] - from[i]).abs(),
                f64::from(settings.speed),
                f64::from(settings.acceleration),
            ) * (to[i] - from[i]).signum();
            let per_step = 1.0 / steps_per_micro(i);
            axis.schedule(&evenly(now, (moved / per_step).round() as i32 - axis.steps()));
            axis.advance(now, Microseconds(now.0 + TICK_US), true);
        }
    }
    run
}

/// Schedules `by` steps evenly over a tick.
fn evenly(start: Microseconds, by: i32) -> StepSchedule {
    let count = by.unsigned_abs();
    let at_ns = (0..count).map(|step| (2 * step + 1) * TICK_US as u32 * 500 / count).collect();
    StepSchedule { start, forward: by > 0, at_ns }
}

fn steps_per_micro(axis: usize) -> f64 {
    let steps = f64::from(bench_settings()[axis].steps_per_unit);
    if axis == 0 { steps / 1e6 } else { steps / (std::f64::consts::TAU * 1e6) }
}

fn counts_at(axis: usize, micro: f64) -> i32 {
    let counts = f64::from(bench_settings()[axis].counts_per_unit);
    let per_micro = if axis == 0 { counts / 1e6 } else { counts / (std::f64::consts::TAU * 1e6) };
    (micro * per_micro).floor() as i32
}

/// The distance moved after `t` seconds.
fn trapezoid(t: f64, distance: f64, speed: f64, acceleration: f64) -> f64 {
    let ramp = (speed / acceleration).min((distance / acceleration).sqrt());
    let speed = ramp * acceleration;
    let cruise = distance / speed.max(f64::MIN_POSITIVE) - ramp;
    if t < ramp {
        0.5 * acceleration * t * t
    } else if t < ramp + cruise {
        speed * (t - 0.5 * ramp)
    } else {
        let left = (2.0 * ramp + cruise - t).max(0.0);
        distance - 0.5 * acceleration * left * left
    }
}

impl Run {
    /// The true positions of the axes, in millimetres and radians.
    fn values_at(&self, us: f64) -> [f64; 2] {
        let place = us / TICK_US as f64;
        let (before, share) = (place.floor() as usize, place.fract());
        let (a, b) = (self.loads[before], self.loads[before + 1]);
        [(a[0] + share * (b[0] - a[0])) * 1e-3, (a[1] + share * (b[1] - a[1])) * 1e-6]
    }

    fn poses_at(&self, rig: &Rig, us: f64) -> (Transform<Base, Left>, Transform<Base, vergence_vision::Right>) {
        let pose = rig.pose_at_values(&self.values_at(us));
        (pose.base_from_left, pose.base_from_left * pose.left_from_right)
    }

    /// Projects `point` into a camera with a rolling shutter, by iteration: the row determines the instant of exposure,
    /// and the instant the row.
    fn seen<C: Frame>(
        &self,
        lens: &KannalaBrandt,
        point: &Point<Base>,
        middle_us: f64,
        place: impl Fn(f64) -> Transform<Base, C>,
    ) -> Option<Pixel> {
        let mut row = 639.5;
        let mut pixel = Pixel::default();
        for _ in 0..8 {
            let us = middle_us + (row - 639.5) * LINE_US;
            pixel = lens.project_point(&(place(us).inverse() * *point)).ok()?;
            row = pixel.v;
        }
        lens.on_sensor(pixel).then_some(pixel)
    }
}

/// The normalised error squared of one random point of each seed, measured at a random instant of `run`.
fn errors(run: &Run, rig: &Rig, seeds: u64, believed: Shutter) -> Vec<f64> {
    let gates = Gates { epipolar_sigmas: 1e3, pixel_sigma: PIXEL_SIGMA, max_relative_sigma: 1.0, ..Gates::default() };
    let mut found = Vec::new();
    for seed in 0..seeds {
        let mut gaussian = Gaussian(seed);
        // An instant in the fastest part of the motion.
        let middle = 300_000.0 + 700_000.0 * gaussian.uniform();
        let aside = Vector3::new(gaussian.uniform() - 0.5, gaussian.uniform() - 0.5, gaussian.uniform()) * 300.0;
        let point = Point::<Base>::from_mm(Vector3::new(75.0, 0.0, 400.0) + aside);
        let (left, right) = (
            run.seen(&rig.left_camera, &point, middle, |us| run.poses_at(rig, us).0),
            run.seen(&rig.right_camera, &point, middle, |us| run.poses_at(rig, us).1),
        );
        let (Some(left), Some(right)) = (left, right) else { continue };
        let pixels = PixelPair { left: gaussian.noisy(left, PIXEL_SIGMA), right: gaussian.noisy(right, PIXEL_SIGMA) };
        let stated = middle + CLOCK_ERROR_US * (2.0 * gaussian.uniform() - 1.0);
        let exposure = Exposure {
            middle: BoardInstant { us: stated, error_us: CLOCK_ERROR_US },
            shutter: believed,
            rows: rig.left_camera.size().height,
        };
        let exposure = PairExposure { left: exposure, right: exposure };
        let cloud = moving_cloud(&[(pixels, gates.pixel_sigma)], rig, &run.track, &exposure, &gates)
            .expect("the track covers the exposure");
        let Some(measured) = cloud.points.first() else { continue };
        let truth = run.poses_at(rig, middle).0.inverse() * point;
        let error = measured.point.mm() - truth.mm();
        let information = measured.covariance.try_inverse().expect("a covariance");
        found.push(error.dot(&(information * error)));
    }
    found
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The mean of n normalised squares of three numbers is 3 ± 1.96 √(6/n) in 95 % of all cases.
fn assert_consistent(name: &str, values: &[f64]) {
    let band = 1.96 * (6.0 / values.len() as f64).sqrt();
    let nees = mean(values);
    println!("{name}: mean NEES {nees:.3} of {} points, 95 % band 3 ± {band:.2}", values.len());
    assert!(values.len() > 300, "{name}: {}", values.len());
    assert!((nees - 3.0).abs() < band, "{name}: {nees} is outside 3 ± {band}");
}

#[test]
fn moving_and_standing_rigs_measure_within_what_they_state() {
    let rig = bench();
    let rolling = Shutter::Rolling { line_us: LINE_US };
    let (moving, standing) = (run(FROM, TO), run([145_000.0, 1_000_000.0], [145_000.0, 1_000_000.0]));
    let speed = moving.values_at(700_000.0)[0] - moving.values_at(690_000.0)[0];
    assert!((speed - 0.8).abs() < 0.02, "the linear stage moves at its full 80 mm/s: {speed} mm in 10 ms");
    assert_consistent("standing", &errors(&standing, &rig, 500, rolling));
    assert_consistent("moving", &errors(&moving, &rig, 500, rolling));
    // The check fails if the shutter is not taken into account.
    assert!(mean(&errors(&moving, &rig, 500, Shutter::Global)) > 10.0);
}

#[test]
fn the_covariance_grows_with_speed_and_clock_error() {
    let rig = bench();
    let (moving, standing) = (run(FROM, TO), run(FROM, FROM));
    let sigma = |run: &Run, error_us: f64| {
        let joints = run.track.at(BoardInstant { us: 700_000.0, error_us }).expect("covered");
        rig.pose(&joints).rotation_sigma.rad()
    };
    assert!(sigma(&moving, 250.0) > 5.0 * sigma(&standing, 250.0));
    assert!(sigma(&moving, 500.0) > 1.9 * sigma(&moving, 250.0));
    assert!((sigma(&standing, 500.0) - sigma(&standing, 0.0)).abs() < 1e-12);
}

#[test]
fn rows_have_their_own_instants() {
    let middle = BoardInstant { us: 1e6, error_us: 3.0 };
    let exposure = Exposure { middle, shutter: Shutter::Rolling { line_us: -10.0 }, rows: 101 };
    assert!((exposure.at_row(50.0).us - 1e6).abs() < 1e-9);
    assert!((exposure.at_row(0.0).us - 1_000_500.0).abs() < 1e-9);
    assert!((exposure.at_row(100.0).error_us - 3.0).abs() < 1e-12);
    let global = Exposure { shutter: Shutter::Global, ..exposure };
    assert_eq!(global.at_row(0.0), middle);
}
