//! A bench whose encoder died, by the command line: rendered photographs tell where the axis stands, and the depth comes with that
//! uncertainty. Room and cameras are simulated; the relative pose is off by what the calibration states.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::sync::Arc;

use common::fails_with;
use common::rendered::{Measurement, Truth, band, median, seeds};
use nalgebra::UnitQuaternion;
use vergence_rig::{BENCH_TOML, Rig, RigCalibration};
use vergence_sim::{Random, Room};
use vergence_vision::Transform;

/// Width of the images: half of the real ones.
const WIDTH: u32 = 640;

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(WIDTH).expect("a sensor")
}

/// The bench in its room, with the stages truly at `baseline` millimetres and `separation` degrees.
fn standing(rig: &Rig, [baseline, separation]: [f64; 2], seed: u64) -> Truth<'_> {
    let mut random = Random::new(9_000 + seed);
    let mut pose = rig.pose_at_values(&[baseline, separation.to_radians()]);
    let RigCalibration::Sigmas { rotation: turn, translation: shift } = rig.calibration else {
        panic!("the bench states its calibration goal");
    };
    let turn = UnitQuaternion::from_scaled_axis(random.vector(turn.rad()));
    let shift = random.vector(shift.mm());
    pose.left_from_right =
        Transform::new(turn * pose.left_from_right.rotation(), pose.left_from_right.origin().mm() + shift);
    Truth { rig, room: Arc::new(Room::with_rig()), pose, seed }
}

/// Position and standard deviation of an axis, in degrees or millimetres.
fn told(measured: &Measurement, axis: &str) -> [f64; 2] {
    let entry = &measured.result["axes_by_images"][axis];
    ["at", "sigma"].map(|name| entry[name].as_f64().unwrap_or_else(|| panic!("{entry}")))
}

fn relative_errors(measured: &Measurement) -> f64 {
    median(measured.points.iter().map(|point| point.relative()))
}

#[test]
fn images_stand_in_for_the_dead_encoder_of_the_separation() {
    let rig = bench();
    let trials = seeds(4);
    let (mut of_pose, mut of_axis) = (0.0, 0.0);
    for seed in 0..trials {
        let truly = 60.0 + 2.0 * Random::new(seed).normal();
        let truth = standing(&rig, [145.0, truly], seed);
        let last_command = ["--baseline", "145mm", "--separation", "60deg", "--uncertain", "separation=2deg"];
        let measured = truth.measure(&last_command);
        let ([at, sigma], relative) = (told(&measured, "separation"), relative_errors(&measured));
        println!(
            "truly {truly:.3}°: {at:.3}° ± {sigma:.3}°; {} points, off by {relative:.4} of the range; NEES of the pose {:.2}",
            measured.points.len(),
            measured.of_pose()
        );
        assert!(sigma < 0.1, "{sigma}");
        assert!(measured.points.len() > 300 && relative < 0.01, "{relative}");
        assert_eq!(measured.result["pose"]["from"], "joints and images");
        of_pose += measured.of_pose() / trials as f64;
        of_axis += ((at - truly) / sigma).powi(2) / trials as f64;
    }
    println!("NEES of {trials}: pose {of_pose:.2} of 6, separation {of_axis:.2} of 1");
    let [low, high] = band(trials, 6.0, 2.24);
    assert!((low..high).contains(&of_pose), "{of_pose} is not within {low} to {high}");
    let [_, high] = band(trials, 1.0, 2.24);
    assert!(of_axis < high, "{of_axis} is above {high}");
}

/// Nobody wrote down where it stood.
#[test]
fn an_axis_is_found_anywhere_in_its_range() {
    let rig = bench();
    for truly in [17.3, 96.4] {
        let truth = standing(&rig, [145.0, truly], 5);
        let measured = truth.measure(&["--baseline", "145mm", "--uncertain", "separation"]);
        let ([at, sigma], relative) = (told(&measured, "separation"), relative_errors(&measured));
        println!("truly {truly}°: {at:.3}° ± {sigma:.3}°, ranges off by {relative:.4}");
        assert!((at - truly).abs() < 4.0 * sigma && sigma < 0.1, "{at} ± {sigma}");
        assert!(relative < 0.01, "{relative}");
    }
}

/// Images tell nothing of the length of the baseline: it stays as uncertain as it is said to be, and so do all ranges.
#[test]
fn a_baseline_that_is_known_badly_makes_all_ranges_uncertain() {
    let rig = bench();
    let truth = standing(&rig, [148.0, 60.0], 6);
    let separation = ["--baseline", "145mm", "--separation", "60deg", "--uncertain", "baseline=3mm"];
    let measured = truth.measure(&separation);
    let [at, sigma] = told(&measured, "baseline");
    let relative = relative_errors(&measured);
    let stated = median(
        measured
            .points
            .iter()
            .map(|point| point.towards.dot(&(point.covariance * point.towards)).sqrt() / point.true_range),
    );
    println!("{at:.2} mm ± {sigma:.2} mm, ranges off by {relative:.4}, stated {stated:.4}");
    assert!((at - 145.0).abs() < 1.0 && (sigma - 3.0).abs() < 0.1, "{at} ± {sigma}");
    assert!(relative > 0.01 && (0.5 * relative..3.0 * relative).contains(&stated), "{relative} {stated}");
}

#[test]
fn what_cannot_be_told_is_refused() {
    let rig = bench();
    let folder = tempfile::tempdir().expect("a folder");
    let options = standing(&rig, [145.0, 60.0], 7).write(folder.path());
    let depth = |more: &[&str], code: i32, words: &[&str]| {
        let options: Vec<&str> = options.iter().map(String::as_str).chain(more.iter().copied()).collect();
        fails_with(&options, code, words);
    };
    let at = ["--baseline", "145mm", "--separation", "60deg"];
    depth(&[&at[..], &["--uncertain", "elbow=2deg"]].concat(), 2, &["elbow", "baseline, separation"]);
    depth(&[&at[..], &["--uncertain", "separation=2mm"]].concat(), 2, &["separation", "another kind"]);
    depth(&[&at[..], &["--uncertain", "separation=2"]].concat(), 2, &["separation=2deg"]);
    depth(&["--separation", "60deg", "--uncertain", "separation"], 2, &["--baseline"]);
    for side in ["left", "right"] {
        let file = folder.path().join(format!("{side}.png"));
        image::RgbImage::new(WIDTH, WIDTH).save(file).expect("a black picture is written");
    }
    depth(&[&at[..], &["--uncertain", "separation=2deg"]].concat(), 1, &["do not tell separation", "texture"]);
    let made: Vec<_> = std::fs::read_dir(folder.path()).expect("a folder").collect();
    assert_eq!(made.len(), 3, "only the inputs are there: {made:?}");
}
