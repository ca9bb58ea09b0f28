//! Which lens the views of simulated ones ask for: the one that they were taken by, neither a poorer nor a richer one.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and shows its figures")]

use nalgebra::{DMatrix, DVector, Isometry3, Point3, SVector, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_calibration::{
    IntrinsicsCalibration, IntrinsicsOptions, LensModel, LensParameters, LensStep, PupilEvidence, StepVerdict,
    calibrate_intrinsics, reproject,
};
use vergence_scene::{Lens, LensChoice, TrueLens};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Angle, Camera, ImageSize, LENS_PARAMETERS, Pixel, Point};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
const CENTRAL: [f64; LENS_PARAMETERS] = [
    599.1, 600.2, 1021.0, 1027.5, -0.052, 0.0041, -0.0019, 0.0002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0,
];
/// About those of a Sigma lens, and of one with elements some micrometres off the axis.
const PUPIL: [f64; LENS_PARAMETERS] = with(CENTRAL, [2.8, 0.0], [0.0; 8]);
const FULL: [f64; LENS_PARAMETERS] = with(CENTRAL, [2.8, 0.7], [4e-4, -3e-4, -3e-4, 2e-4, 4e-4, -1e-4, -7e-5, 3e-5]);

/// A radius that five terms are up to 0.15 px off.
const LONGER: [f64; LENS_PARAMETERS] = [
    598.1, 599.2, 1021.0, 1027.5, -0.0408, -0.0176, 0.0153, -0.0057, 2.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.5e-4,
    -2e-5, 0.0, 0.0,
];

const fn with(
    mut lens: [f64; LENS_PARAMETERS],
    pupil: [f64; 2],
    [p1, p2, s0, s1, s2, s3, p3, p4]: [f64; 8],
) -> [f64; LENS_PARAMETERS] {
    (lens[8], lens[9]) = (pupil[0], pupil[1]);
    (lens[10], lens[11], lens[12], lens[13], lens[14], lens[15]) = (p1, p2, s0, s1, s2, s3);
    (lens[18], lens[19]) = (p3, p4);
    lens
}

/// Standard normal, by G. Box and M. Muller, 1958.
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A target 150 to 400 mm away, up to 85 degrees from the axis, tilted by up to 30 degrees.
fn pose(rng: &mut Pcg64Mcg) -> Isometry3<f64> {
    let theta = 1.48 * rng.random_range(0.0..1.0_f64).sqrt();
    let phi = rng.random_range(-3.2..3.2);
    let towards = Vector3::new(theta.sin() * f64::cos(phi), theta.sin() * f64::sin(phi), theta.cos());
    let tilt = UnitQuaternion::from_euler_angles(
        rng.random_range(-0.5..0.5),
        rng.random_range(-0.5..0.5),
        rng.random_range(-3.0..3.0),
    );
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards).unwrap_or_default() * tilt;
    Isometry3::from_parts(Translation3::from(towards * rng.random_range(150.0..400.0)), facing)
}

/// 40 views of 9 x 6 corners at 25 mm with noise of 0.1 px.
fn views(lens: [f64; LENS_PARAMETERS], seed: u64) -> Vec<TargetView> {
    let lens = LensParameters::from_array(lens);
    let image = |at: &Point<Camera>| reproject(lens, at).map(|seen| Pixel { u: seen.pixel[0], v: seen.pixel[1] });
    views_by(image, 0.1, seed)
}

/// The same by any lens and with any noise.
fn views_by(image: impl Fn(&Point<Camera>) -> Option<Pixel>, noise_px: f64, seed: u64) -> Vec<TargetView> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let view = |index: usize| {
        let pose = pose(&mut rng);
        let corners = (0..54).filter_map(|i| {
            let target_mm = [25.0 * f64::from(i % 9) - 100.0, 25.0 * f64::from(i / 9) - 62.5];
            let at = Point::<Camera>::from_mm((pose * Point3::new(target_mm[0], target_mm[1], 0.0)).coords);
            let seen = image(&at)?;
            let pixel = Pixel { u: seen.u + noise_px * normal(&mut rng), v: seen.v + noise_px * normal(&mut rng) };
            (at.direction()?.angle_to_axis().deg() < 98.0).then_some(Corner::new(target_mm, pixel))
        });
        TargetView { name: format!("view {index}"), corners: corners.collect() }
    };
    (0..40).map(view).collect()
}

fn calibrated(lens: [f64; LENS_PARAMETERS], seed: u64) -> IntrinsicsCalibration {
    calibrate_intrinsics(&views(lens, seed), SIZE, &IntrinsicsOptions::default()).unwrap()
}

fn has(calibration: &IntrinsicsCalibration, step: LensStep) -> bool {
    calibration.steps.iter().any(|evidence| evidence.step == step && evidence.verdict == StepVerdict::Found)
}

fn finds_more(calibration: &IntrinsicsCalibration) -> bool {
    [LensStep::PupilGrowth, LensStep::Asymmetry, LensStep::FurtherTerms].into_iter().any(|step| has(calibration, step))
}

fn seeds(usual: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// A lens with parameters that it does not have makes depths less certain for nothing.
#[test]
fn one_lens_in_twenty_at_most_is_found_richer_than_it_is() {
    let seeds = seeds(10);
    let (mut richer, mut poorer) = (0, 0);
    for seed in 0..seeds {
        let central = calibrated(CENTRAL, seed);
        let moves = matches!(central.pupil, PupilEvidence::Moves { .. });
        richer += u64::from(moves || finds_more(&central));
        let pupil = calibrated(PUPIL, 1000 + seed);
        richer += u64::from(finds_more(&pupil));
        poorer += u64::from(pupil.camera.is_central());
    }
    println!("{richer} of {} richer, {poorer} of {seeds} poorer", 2 * seeds);
    assert!(20 * richer <= 2 * seeds && poorer == 0, "{richer} of {} richer, {poorer} poorer", 2 * seeds);
}

/// The errors of the parameters that a lens with further radial terms has agree with their covariance: the normalised square, for each, is 1.
#[test]
fn further_terms_of_the_radius_are_found_with_their_covariance() {
    let seeds = seeds(10);
    let (mut found, mut square, mut unknowns) = (0, 0.0, 0);
    for seed in 0..seeds {
        let calibration = calibrated(LONGER, 3000 + seed);
        if !has(&calibration, LensStep::FurtherTerms) {
            continue;
        }
        found += 1;
        let (values, covariance) = (calibration.lens().to_array(), &calibration.covariance);
        let unknown: Vec<usize> = (0..LENS_PARAMETERS).filter(|&i| covariance[(i, i)] > 0.0).collect();
        assert!(unknown.contains(&16) && unknown.contains(&17) && calibration.camera.has_further_terms());
        // Scaled to unit diagonal: the parameters differ by many orders of magnitude.
        let sigma = |i: usize| covariance[(i, i)].sqrt();
        let count = unknown.len();
        let correlation = DMatrix::from_fn(count, count, |row, column| {
            let (i, k) = (unknown[row], unknown[column]);
            covariance[(i, k)] / (sigma(i) * sigma(k))
        });
        let error = DVector::from_iterator(count, unknown.iter().map(|&i| (values[i] - LONGER[i]) / sigma(i)));
        square += error.dot(&correlation.cholesky().unwrap().solve(&error));
        unknowns += count;
    }
    let each = square / unknowns as f64;
    println!("{found} of {seeds} found; normalised square of each parameter {each:.2}");
    assert!(10 * found >= 9 * seeds, "{found} of {seeds} found");
    assert!((0.6..1.4).contains(&each), "{each} of 1");
}

/// Traced through a published design, whose radius five terms miss by up to 0.08 px: with next to no noise about a hundredth of a
/// pixel is left, between 200 and 800 mm and up to 80 degrees from the axis.
#[test]
fn a_true_lens_is_met_by_further_terms() {
    let drawn = LensParameters::from_array(CENTRAL).camera(Angle::from_deg(98.0), SIZE).unwrap();
    let lens = "sigma8_f18".parse::<LensChoice>().unwrap().in_place_of(&drawn).unwrap();
    for seed in 0..seeds(2) {
        let views = views_by(|at| lens.image_of(at), 1e-4, 4000 + seed);
        let [longer, shorter] = [LensModel::ByEvidence, LensModel::Full].map(|model| {
            let options = IntrinsicsOptions { model, ..IntrinsicsOptions::default() };
            calibrate_intrinsics(&views, SIZE, &options).unwrap()
        });
        assert!(has(&longer, LensStep::FurtherTerms), "{:?}", longer.steps);
        let [longer, shorter] = [&longer, &shorter].map(|found| worst_px(&lens, found));
        println!("seed {seed}: {longer:.4} px with further terms, {shorter:.4} px without");
        assert!(longer < 0.02 && longer < 0.6 * shorter, "{longer} and {shorter} px");
    }
}

/// The largest distance between images of a point by the lens and by its calibration.
fn worst_px(lens: &TrueLens, found: &IntrinsicsCalibration) -> f64 {
    let off = |place: u32| {
        let (theta, phi) = (1.4 * f64::from(place) / 600.0, 2.4 * f64::from(place));
        let towards = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let at = Point::from_mm(towards * (200.0 + 50.0 * f64::from(place % 13)));
        let (truth, seen) = (lens.image_of(&at).unwrap(), found.camera.project_point(&at).unwrap());
        (truth.u - seen.u).hypot(truth.v - seen.v)
    };
    (1..600).map(off).fold(0.0, f64::max)
}

/// The errors of all parameters of a full lens agree with their covariance, whose normalised square has the mean 18 and over n draws the
/// standard deviation (36 / n)^(1/2).
#[test]
fn a_lens_with_all_parameters_is_found_with_its_covariance() {
    let seeds = seeds(10);
    let (mut asymmetric, mut found, mut nees) = (0, 0, 0.0);
    for seed in 0..seeds {
        let calibration = calibrated(FULL, 2000 + seed);
        asymmetric += u64::from(has(&calibration, LensStep::Asymmetry));
        if !has(&calibration, LensStep::PupilGrowth) || !has(&calibration, LensStep::Asymmetry) {
            continue;
        }
        found += 1;
        let error = SVector::from(calibration.lens().to_array()) - SVector::from(FULL);
        // What such a lens does not have is left out.
        let (error, covariance) = (error.remove_fixed_rows::<2>(16), calibration.covariance.remove_fixed_rows::<2>(16));
        let covariance = covariance.remove_fixed_columns::<2>(16);
        // Scaled to unit diagonal: the parameters differ by many orders of magnitude.
        let scale = covariance.diagonal().map(f64::sqrt);
        let correlation = covariance.component_div(&(scale * scale.transpose()));
        let error = error.component_div(&scale);
        nees += error.dot(&correlation.cholesky().unwrap().solve(&error));
    }
    let (mean, allowed) = (nees / found as f64, 4.0 * (36.0 / found as f64).sqrt());
    println!("{asymmetric} of {seeds} found asymmetric, {found} whole; NEES of these {mean:.1} of 18");
    // Half of the views hardly tell e1, so that those held out get worse with it now and then.
    assert!(asymmetric == seeds && 10 * found >= 7 * seeds, "{asymmetric} of {seeds} found asymmetric, {found} whole");
    assert!((mean - 18.0).abs() < allowed, "{mean} is not within {allowed} of 18");
}

#[test]
fn each_model_has_the_parameters_that_its_name_says() {
    let views = views(FULL, 7);
    let of = |model: LensModel| {
        let options = IntrinsicsOptions { model, ..IntrinsicsOptions::default() };
        let covariance = calibrate_intrinsics(&views, SIZE, &options).unwrap().covariance;
        covariance.diagonal().iter().filter(|variance| **variance > 0.0).count()
    };
    assert_eq!(of(LensModel::Central), 8);
    assert_eq!(of(LensModel::MovingPupil), 9);
    assert_eq!(of(LensModel::Full), 18);
    for name in ["central", "moving-pupil", "full", "by-evidence"] {
        assert_eq!(name.parse::<LensModel>().unwrap().to_string(), name);
    }
    assert!("rich".parse::<LensModel>().is_err());
}
