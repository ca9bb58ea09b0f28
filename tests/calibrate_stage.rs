//! Stages calibrated by the command line: recorded corners, a rig that drives itself, and what bad input is told.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::fmt::Write;
use std::path::Path;

use common::{fails_with, run_json};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_rig::{BENCH_TOML, Rig};
use vergence_vision::{KannalaBrandt, Left, Pixel, Point, Right, Transform};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench")
}

/// The bench with its screws and encoders off by what a workshop leaves.
fn as_built() -> Rig {
    let off = BENCH_TOML
        .replace("slide_along = [1.0, 0.0, 0.0]", "slide_along = [1.0, 0.012, -0.009]")
        .replacen("turn_about = [0.0, 1.0, 0.0]", "turn_about = [0.011, 1.0, -0.006]", 1)
        .replacen("through = [\"0mm\", \"0mm\", \"0mm\"]", "through = [\"2.5mm\", \"0mm\", \"-3mm\"]", 1)
        .replace("share = 1.0", "share = 1.003");
    Rig::from_toml(&(off + "[right.at_zero]\norigin = [\"1.5mm\", \"-0.8mm\", \"2mm\"]\n")).expect("a rig")
}

/// Numbers from -1 to 1, evenly and about normally distributed.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.uniform()).sum()
    }
}

/// The pixel of every corner, off by 0.1 px; `None` where one is not seen.
fn seen(
    lens: &KannalaBrandt,
    camera_from_left: &Isometry3<f64>,
    target: &[Vector3<f64>],
    dice: &mut Dice,
) -> Option<Vec<Pixel>> {
    let corner = |at: &Vector3<f64>| {
        let point = camera_from_left * Point3::from(*at);
        let exact = lens.project_point(&Point::<Left>::from_mm(point.coords)).ok().filter(|p| lens.on_sensor(*p))?;
        Some(Pixel { u: exact.u + 0.1 * dice.normal(), v: exact.v + 0.1 * dice.normal() })
    };
    target.iter().map(corner).collect()
}

/// A 9 x 6 target of 20 mm somewhere between the optical axes, in the left frame.
fn target(rig: &Rig, at: [f64; 2], dice: &mut Dice) -> Vec<Vector3<f64>> {
    let right_axis = rig.pose_at_values(&at).left_from_right.rotation() * Vector3::z();
    let middle = (Vector3::z() + right_axis).normalize();
    let towards = (middle + 0.5 * Vector3::new(dice.uniform(), dice.uniform(), dice.uniform())).normalize();
    let tilt = UnitQuaternion::from_euler_angles(0.6 * dice.uniform(), 0.6 * dice.uniform(), dice.uniform());
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &towards).expect("not opposite") * tilt;
    let centre = towards * (330.0 + 100.0 * dice.uniform());
    let corner = |i: u32| Vector3::new(20.0 * f64::from(i % 9) - 80.0, 20.0 * f64::from(i / 9) - 50.0, 0.0);
    (0..54).map(|i| centre + rotation * corner(i)).collect()
}

/// Corners and readings of `views` targets at each of `poses` (millimetres and radians), of a stage that returns exactly.
fn csv(rig: &Rig, poses: &[[f64; 2]], views: usize) -> String {
    returning_csv(rig, poses, views, [0.0; 2])
}

/// The same of a stage that comes to each pose a little beside it, turned and shifted by so many radians and millimetres, as standard deviations.
fn returning_csv(rig: &Rig, poses: &[[f64; 2]], views: usize, [turned, shifted]: [f64; 2]) -> String {
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm,baseline_mm,separation_deg\n");
    let (mut dice, mut frame, mut beside) = (Dice(7), 0, Dice(11));
    for &at in poses {
        let [turn, shift] = [turned, shifted].map(|sigma| Vector3::from_fn(|_, _| sigma * beside.normal()));
        let beside: Transform<Right, Right> = Transform::new(UnitQuaternion::from_scaled_axis(turn), shift);
        let left_from_right: Transform<Left, Right> = rig.pose_at_values(&at).left_from_right * beside;
        let mut taken = 0;
        while taken < views {
            let target = target(rig, at, &mut dice);
            let left = seen(&rig.left_camera, &Isometry3::identity(), &target, &mut dice);
            let right = seen(&rig.right_camera, left_from_right.inverse().isometry(), &target, &mut dice);
            let (Some(left), Some(right)) = (left, right) else { continue };
            for (name, pixels) in [("left", left), ("right", right)] {
                for (index, pixel) in pixels.iter().enumerate() {
                    let (x, y) = (20 * (index % 9), 20 * (index / 9));
                    let (mm, deg) = (at[0], at[1].to_degrees());
                    writeln!(text, "{name},f{frame}.png,{frame},{index},{},{},{x},{y},{mm},{deg}", pixel.u, pixel.v)
                        .expect("text");
                }
            }
            (taken, frame) = (taken + 1, frame + 1);
        }
    }
    text
}

/// The rms differences of the relative pose over the range, in degrees and millimetres.
fn off(found: &Rig, truth: &Rig) -> (f64, f64) {
    let places = (0..25).map(|i| [60.0 + 40.0 * f64::from(i % 5), 0.56 * f64::from(i / 5)]);
    let squares = places.map(|at| {
        let [a, b] = [found, truth].map(|rig| rig.pose_at_values(&at).left_from_right);
        (a.rotation().angle_to(&b.rotation()).powi(2), (a.origin().mm() - b.origin().mm()).norm_squared())
    });
    let (turn, shift) = squares.fold((0.0, 0.0), |sum, (turn, shift)| (sum.0 + turn, sum.1 + shift));
    ((turn / 25.0).sqrt().to_degrees(), (shift / 25.0).sqrt())
}

const SIX: [[f64; 2]; 6] = [[60.0, 0.0], [220.0, 0.0], [60.0, 2.2], [220.0, 2.2], [140.0, 1.1], [145.0, 2.0]];

#[test]
fn recorded_corners_give_a_rig_file_for_every_pose() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out, page) = (file("corners.csv"), file("rig.toml"), file("report.html"));
    let truth = as_built();
    std::fs::write(&corners, csv(&truth, &SIX, 12)).expect("written");
    let arguments = ["calibrate", "stage", "--json", "--csv", &corners, "--out", &out, "--report", &page];
    let places = ["--verdict", "350mm,1m at -15deg,0deg,15deg with 0.1px"];
    let result = run_json(&[&arguments[..], &["--holdout", "--date", "2026-11-21"], &places].concat());
    println!("{}", result["verdict"]);
    // Two ranges and three directions in each of two modes.
    let told = result["verdict"]["places"].as_array().expect("places");
    let is_told = |place: &&Value| number(&place["along_sigma_mm"]) > number(&place["across_sigma_mm"]);
    assert_eq!((told.len(), told.iter().filter(is_told).count()), (12, 12));
    assert_eq!(result["poses"].as_array().map(Vec::len), Some(6));
    assert!(number(&result["rms_inlier_px"]) < 0.2 && number(&result["corners_total"]) > 7_500.0);
    for held_out in result["held_out"].as_array().expect("six") {
        assert!(number(&held_out["translation_mm"]) < 0.3 && number(&held_out["chi_square"]) < 25.0, "{held_out}");
    }
    let verdict = result["verdict"]["text"].as_str().expect("words");
    assert!(
        verdict.contains("mm in herbivore") && verdict.contains("at 350 mm") && verdict.contains("weakest"),
        "{verdict}"
    );
    let text = std::fs::read_to_string(&out).expect("a rig file");
    let (turn, shift) = off(&Rig::from_toml(&text).expect("a rig"), &truth);
    println!("unseen poses: {turn:.4} deg, {shift:.4} mm rms");
    assert!(turn < 0.02 && shift < 0.1 && text.contains("2026-11-21"));
    let (drawn_turn, drawn_shift) = off(&bench(), &truth);
    println!("by the drawing: {drawn_turn:.4} deg, {drawn_shift:.4} mm rms");
    assert!(drawn_turn > 0.3 && drawn_shift > 1.0, "the drawing was right already");
    let html = std::fs::read_to_string(&page).expect("a report");
    assert!(html.contains(verdict) && !html.contains("NaN"));
    // Every verb takes it.
    let home = run_json(&["--rig", &out, "--port", "sim", "home", "--json"]);
    assert_eq!(home["referenced"], serde_json::json!([true, true]));
}

#[test]
fn a_stage_that_does_not_return_exactly_says_so_in_its_file() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out) = (file("corners.csv"), file("rig.toml"));
    let calibrated = |returns: [f64; 2]| {
        std::fs::write(&corners, returning_csv(&as_built(), &SIX, 12, returns)).expect("written");
        run_json(&["calibrate", "stage", "--json", "--csv", &corners, "--out", &out]);
        let text = std::fs::read_to_string(&out).expect("a rig file");
        Rig::from_toml(&text).expect("a rig").repeatability
    };
    let returns = [0.05_f64.to_radians(), 0.05];
    let found = calibrated(returns).expect("it returns differently each time");
    println!("{found:?}");
    // Six poses, three components each.
    assert!((0.4..2.0).contains(&(found.rotation.rad() / returns[0])), "{found:?}");
    assert!((0.4..2.0).contains(&(found.translation.mm() / returns[1])), "{found:?}");
    assert_eq!(calibrated([0.0; 2]), None);
}

#[test]
fn three_poses_suffice_and_say_which_would_help() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out) = (file("corners.csv"), file("rig.toml"));
    let truth = as_built();
    std::fs::write(&corners, csv(&truth, &[[60.0, 0.0], [220.0, 1.1], [100.0, 2.2]], 12)).expect("written");
    let result = run_json(&["calibrate", "stage", "--json", "--csv", &corners, "--out", &out]);
    let weak = result["observability"]["weak"].as_array().expect("a list");
    let words = result["observability"]["text"].as_str().expect("words");
    println!("{words}");
    assert!(!weak.is_empty() && words.contains("add a pose at"));
    let (turn, shift) = off(&Rig::from_toml(&std::fs::read_to_string(&out).expect("a file")).expect("a rig"), &truth);
    println!("unseen poses: {turn:.4} deg, {shift:.4} mm rms");
    assert!(turn < 0.02 && shift < 1.0);
}

#[test]
fn a_pose_with_too_few_views_is_left_out_and_told() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out, page) = (file("corners.csv"), file("rig.toml"), file("report.html"));
    let truth = as_built();
    // Of the twelve frames of the third pose two are left.
    let is_there = |row: &&str| {
        row.split(',').nth(2).and_then(|frame| frame.parse().ok()).is_none_or(|n: u32| !(26..36).contains(&n))
    };
    std::fs::write(&corners, csv(&truth, &SIX, 12).lines().filter(is_there).collect::<Vec<_>>().join("\n"))
        .expect("written");
    let result = run_json(&["calibrate", "stage", "--json", "--csv", &corners, "--out", &out, "--report", &page]);
    let reason = "2 views in which both cameras see enough of the target; at least 3 are needed";
    assert_eq!(result["left_out"], serde_json::json!([{ "view": "stage pose 3", "reason": reason }]));
    assert_eq!(result["poses"].as_array().map(Vec::len), Some(5));
    assert!(std::fs::read_to_string(&page).expect("a report").contains("stage pose 3"));
    let (turn, shift) = off(&Rig::from_toml(&std::fs::read_to_string(&out).expect("a file")).expect("a rig"), &truth);
    println!("unseen poses: {turn:.4} deg, {shift:.4} mm rms");
    assert!(turn < 0.02 && shift < 0.1);
}

#[test]
fn bad_stage_data_is_told_and_leaves_no_file() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out, page) = (file("corners.csv"), file("rig.toml"), file("report.html"));
    let truth = as_built();
    let good = csv(&truth, &SIX[..3], 4);
    let still = csv(&truth, &[[60.0, 0.0], [140.0, 0.0], [220.0, 0.0]], 6);
    let cases: Vec<(String, i32, &[&str])> = vec![
        (csv(&truth, &SIX[..2], 4), 2, &["2 stage poses", "3", "6"]),
        (csv(&truth, &SIX[..3], 2), 2, &["stage pose 1", "views"]),
        (still, 1, &["separation", "never moved", "add a pose"]),
        (good.replace("separation_deg", "angle"), 2, &["separation_deg", "corners.csv"]),
        (good.replacen(",60,0\n", ",NaN,0\n", 1), 2, &["NaN", "baseline_mm", "line 2"]),
        (good.replacen(",60,0\n", ",6000,0\n", 1), 2, &["6000", "range"]),
        (good.replacen(",60,0\n", ",70,0\n", 1), 2, &["frame 0", "two different readings"]),
        (good.replace("right,f", "other,f"), 2, &["right", "other"]),
        ("camera,frame\n".into(), 2, &["baseline_mm"]),
    ];
    for (text, code, words) in cases {
        std::fs::write(&corners, text).expect("written");
        fails_with(&["calibrate", "stage", "--csv", &corners, "--out", &out, "--report", &page], code, words);
        assert!(!Path::new(&out).exists() && !Path::new(&page).exists());
    }
    std::fs::write(&corners, good).expect("written");
    fails_with(&["calibrate", "stage", "--csv", &corners, "--lenses", "known", "--out", &out], 2, &["--left"]);
    fails_with(&["calibrate", "stage", "--out", &out], 2, &["--set", "--csv"]);
    fails_with(&["calibrate", "stage", "--set", &file("none"), "--out", &out], 2, &["poses.csv"]);
    let target = ["--corners", "9x6", "--square", "20mm"];
    let live = ["--port", "sim", "calibrate", "stage", "--live", "--set", &file("set")];
    fails_with(&[&live[..], &target, &["--cameras", "/dev/none", "/dev/none"]].concat(), 2, &["--cameras sim"]);
    assert!(!Path::new(&out).exists() && !Path::new(&file("set")).exists());
}

/// A small lens past 90°, so that rendering is quick.
fn small_rig() -> String {
    BENCH_TOML.replace("[1280, 1280]", "[480, 480]").replace("366.0", "137.0").replace("639.5", "239.5")
}

#[test]
fn a_simulated_rig_calibrates_itself() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (drawing, set, out) = (file("drawing.toml"), file("set"), file("rig.toml"));
    std::fs::write(&drawing, small_rig()).expect("written");
    let common =
        ["--rig", &drawing, "calibrate", "stage", "--json", "--corners", "7x5", "--square", "30mm", "--set", &set];
    let live = ["--port", "sim", "--live", "--cameras", "sim", "--poses", "4", "--views", "4", "--seed", "3"];
    let result = run_json(&[&common[..], &live].concat());
    println!("{}\n{}", result["verdict"]["text"], result["truth"]);
    // So few views of so few pixels do not tell much, and the calibration says so.
    for (error, sigma) in [("rotation_rms_deg", "rotation_deg"), ("translation_rms_mm", "translation_mm")] {
        let (error, sigma) = (number(&result["truth"][error]), number(&result["calibration_sigma"][sigma]));
        println!("{error} off, {sigma} expected");
        assert!(error < 2.0 * sigma);
    }
    assert!(number(&result["truth"]["translation_rms_mm"]) < 1.5);
    // The set that it took is a record like any other, and is not overwritten.
    let again = run_json(&[&common[..], &["--out", &out]].concat());
    assert_eq!(again["rms_inlier_px"], result["rms_inlier_px"]);
    assert!(Path::new(&out).exists());
    fails_with(&[&common[..], &live].concat(), 2, &["holds a set already"]);
    // Images of another camera, or a target of another kind.
    fails_with(
        &["calibrate", "stage", "--corners", "7x5", "--square", "30mm", "--set", &set],
        2,
        &["480 x 480", "1280"],
    );
    let wrong = ["--rig", &drawing, "calibrate", "stage", "--corners", "9x6", "--square", "30mm", "--set", &set];
    fails_with(&wrong, 2, &["no target"]);
}
