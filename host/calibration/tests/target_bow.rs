//! Targets that bow, and flat ones: which of them calibrations find bent, and what held-out views say.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and shows its figures")]

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_calibration::{
    ExtrinsicsOptions, IntrinsicsOptions, LensParameters, LensStep, StepVerdict, StereoView, calibrate_extrinsics,
    calibrate_intrinsics, reproject, validate_extrinsics, validate_intrinsics,
};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Angle, Camera, ImageSize, LENS_PARAMETERS, Pixel, Point};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
/// With a pupil that moves, as real lenses have.
const LENS: [f64; LENS_PARAMETERS] = [
    599.1, 600.2, 1021.0, 1027.5, -0.052, 0.0041, -0.0019, 0.0002, 2.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0,
];
const NOISE_PX: f64 = 0.1;
/// Of 7 x 5 corners at 30 mm.
const HALF_MM: [f64; 2] = [90.0, 60.0];

/// Standard normal, by G. Box and M. Muller, 1958.
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A target 150 to 400 mm away, up to `widest` radians from the axis, tilted by up to 30 degrees.
fn pose(widest: f64, rng: &mut Pcg64Mcg) -> Isometry3<f64> {
    let theta = widest * rng.random_range(0.0..1.0_f64).sqrt();
    let phi = rng.random_range(-3.2..3.2);
    let towards = Vector3::new(theta.sin() * f64::cos(phi), theta.sin() * f64::sin(phi), theta.cos());
    let mut turn = || rng.random_range(-0.5..0.5);
    let tilt = UnitQuaternion::from_euler_angles(turn(), turn(), 6.0 * turn());
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards).unwrap_or_default() * tilt;
    Isometry3::from_parts(Translation3::from(towards * rng.random_range(150.0..400.0)), facing)
}

/// The corners of a target whose middle stands out by `bow_mm` over its left and right edges.
fn seen(name: &str, pose: &Isometry3<f64>, bow_mm: f64, rng: &mut Pcg64Mcg) -> TargetView {
    let lens = LensParameters::from_array(LENS);
    let corners = (0..35).filter_map(|i| {
        let target_mm = [30.0 * f64::from(i % 7) - HALF_MM[0], 30.0 * f64::from(i / 7) - HALF_MM[1]];
        let height = bow_mm * (1.0 - (target_mm[0] / HALF_MM[0]).powi(2));
        let at = Point::<Camera>::from_mm((pose * Point3::new(target_mm[0], target_mm[1], height)).coords);
        let [u, v] = reproject(lens, &at)?.pixel;
        let pixel = Pixel { u: u + NOISE_PX * normal(rng), v: v + NOISE_PX * normal(rng) };
        (at.direction()?.angle_to_axis().deg() < 98.0).then_some(Corner::new(target_mm, pixel))
    });
    TargetView { name: name.to_owned(), corners: corners.collect() }
}

fn views(count: usize, bow_mm: f64, seed: u64) -> Vec<TargetView> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let view = |index| {
        let pose = pose(1.48, &mut rng);
        seen(&format!("view {index}"), &pose, bow_mm, &mut rng)
    };
    (0..count).map(view).collect()
}

/// 12 views of two cameras 90 mm apart that look the same way.
fn pairs(bow_mm: f64, seed: u64) -> Vec<StereoView> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let pair = |index| {
        let in_left = pose(0.9, &mut rng);
        let in_right = Translation3::new(-90.0, 0.0, 0.0) * in_left;
        let name = format!("view {index}");
        let [left, right] = [in_left, in_right].map(|pose| seen(&name, &pose, bow_mm, &mut rng));
        StereoView { name, left, right }
    };
    (0..12).map(pair).collect()
}

fn bow_verdict(bow_mm: f64, views: usize, seed: u64) -> StepVerdict {
    let views = self::views(views, bow_mm, seed);
    let found = calibrate_intrinsics(&views, SIZE, &IntrinsicsOptions::default()).unwrap();
    let verdict = found.steps.iter().find(|evidence| evidence.step == LensStep::TargetBow).unwrap().verdict;
    assert_eq!(found.warp.is_some(), verdict != StepVerdict::Absent);
    verdict
}

fn seeds() -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(50)
}

/// Of lenses, and of pairs of cameras, at most one in twenty finds a flat target bent.
#[test]
fn a_flat_target_is_not_found_bent() {
    let seeds = seeds();
    let lenses = (0..seeds).filter(|seed| bow_verdict(0.0, 16, *seed) == StepVerdict::Found).count() as u64;
    let lens = LensParameters::from_array(LENS).camera(Angle::from_deg(100.0), SIZE).unwrap();
    let is_bent = |seed: &u64| {
        let found = calibrate_extrinsics(&lens, &lens, &pairs(0.0, *seed), &ExtrinsicsOptions::default()).unwrap();
        found.warp.is_some()
    };
    let pairs = (0..seeds).filter(is_bent).count() as u64;
    println!("bent: {lenses} of {seeds} by lenses, {pairs} of {seeds} by pairs");
    assert!(20 * lenses <= seeds && 20 * pairs <= seeds, "{lenses} and {pairs} of {seeds}");
}

/// Half a millimetre in 180: without asking for it.
#[test]
fn a_bent_target_is_found_and_held_out_views_are_predicted_with_its_bow() {
    let views = views(20, 0.5, 1);
    let options = IntrinsicsOptions::default();
    let found = calibrate_intrinsics(&views, SIZE, &options).unwrap();
    let warp = found.warp.unwrap();
    assert!((warp.shape.along_x_mm - 0.5).abs() < 5.0 * warp.sigma_mm[0] && warp.sigma_mm[0] < 0.05, "{warp:?}");
    assert!(warp.shape.along_y_mm.abs() < 5.0 * warp.sigma_mm[1], "{warp:?}");
    assert!((0..2).all(|axis| (warp.shape.half_mm[axis] - HALF_MM[axis]).abs() < 1e-9), "{warp:?}");
    let held_out = validate_intrinsics(&views, SIZE, &options, &found, 5).unwrap();
    // Residuals of noise alone, a little more where the lens is known from fewer views; a flat target leaves 0.3 px.
    assert!(held_out.rms_px < 1.15 * 2.0_f64.sqrt() * NOISE_PX, "{} px", held_out.rms_px);
    let flat = calibrate_intrinsics(&views, SIZE, &IntrinsicsOptions::central()).unwrap();
    let by_flat = validate_intrinsics(&views, SIZE, &IntrinsicsOptions::central(), &flat, 5).unwrap();
    assert!(by_flat.rms_px > 1.5 * held_out.rms_px, "{} and {} px", by_flat.rms_px, held_out.rms_px);
}

/// The pair is where it is, by its covariance, and views held out are predicted with the bow.
#[test]
fn a_pair_before_a_bent_target_is_as_far_off_as_it_states() {
    let lens = LensParameters::from_array(LENS).camera(Angle::from_deg(100.0), SIZE).unwrap();
    let options = ExtrinsicsOptions::default();
    const SEEDS: u64 = 8;
    let mut nees = 0.0;
    for seed in 0..SEEDS {
        let views = pairs(0.5, seed);
        let found = calibrate_extrinsics(&lens, &lens, &views, &options).unwrap();
        let warp = found.warp.unwrap();
        assert!((warp.shape.along_x_mm - 0.5).abs() < 5.0 * warp.sigma_mm[0], "{warp:?}");
        let (turn, shift) =
            (found.joint.left_from_right.rotation().scaled_axis(), found.joint.left_from_right.origin().mm());
        let off = nalgebra::Vector6::new(turn.x, turn.y, turn.z, shift.x - 90.0, shift.y, shift.z);
        nees += off.dot(&found.covariance.cholesky().unwrap().solve(&off)) / SEEDS as f64;
        let held_out = validate_extrinsics((&lens, &lens), &views, &options, &found, 4).unwrap();
        assert!(held_out.rms_px < 1.2 * 2.0_f64.sqrt() * NOISE_PX, "{} px", held_out.rms_px);
    }
    // Of six numbers; the mean of 8 draws has the standard deviation (12 / 8)^(1/2).
    assert!((2.3..9.7).contains(&nees), "{nees} of 6");
}
