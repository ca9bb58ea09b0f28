//! Calibration by the command line: other programs' corners and the program's own.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::cameras::camera_files;
use common::{fails_with, real_data, run_json};
use nalgebra::Vector3;
use serde_json::Value;
use vergence_scene::{Lens, LensChoice};
use vergence_vision::{Camera, KannalaBrandt, Point};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn reference(set: &Path, file: &str) -> Value {
    let text = std::fs::read_to_string(set.join(file)).expect("a reference");
    serde_json::from_str(&text).expect("JSON")
}

/// Set, corners, camera, image size, reference, its camera.
const SETS: [[&str; 6]; 5] = [
    ["sourishg_stereo", "corners_opencv_classic.csv", "left", "960x600", "reference_opencv_classic_cv5.json", "left"],
    ["sourishg_stereo", "corners_opencv_classic.csv", "right", "960x600", "reference_opencv_classic_cv5.json", "right"],
    ["ocam_fisheye1", "corners_opencv_classic.csv", "", "1032x778", "reference_opencv_classic_cv5.json", ""],
    ["ov_plane", "corners_babelcalib_train.csv", "", "1280x800", "reference_babelcalib_train_cv5.json", ""],
    ["ov_plane", "corners_babelcalib_test.csv", "", "1280x800", "reference_babelcalib_test_cv5.json", ""],
];

/// SciPy's bundle adjustment of the same corners, started at its own optimum, is the reference.
#[test]
fn every_real_set_comes_to_the_reference_optimum_without_a_hint() {
    for [set, corners, camera, size, file, named] in SETS {
        let Some(folder) = real_data(&format!("data/{set}")) else { return };
        let csv = folder.join(corners).to_string_lossy().into_owned();
        let mut arguments = vec!["calibrate", "intrinsics", "--json", "--csv", &csv, "--size", size];
        // The references are of lenses with one centre.
        arguments.extend(["--lens-model", "central"]);
        if !camera.is_empty() {
            arguments.extend(["--camera", camera]);
        }
        let ours = run_json(&arguments);
        let stored = reference(&folder, file);
        let mono = &stored["mono"];
        let theirs = if named.is_empty() {
            mono.as_object().and_then(|m| m.values().next()).expect("one")
        } else {
            &mono[named]
        };
        let trimmed = &theirs["kb4_scipy_ba_trimmed"];
        println!("{set} {camera}: {} px, reference {} px", ours["rms_inlier_px"], trimmed["rms_px"]);
        assert!(number(&ours["rms_inlier_px"]) <= 1.01 * number(&trimmed["rms_px"]));
        for (index, name) in ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"].into_iter().enumerate() {
            let expected = number(&trimmed["fx_fy_cx_cy_k1_k2_k3_k4"][index]);
            let off = (number(&ours["opencv"][name]) - expected).abs() / number(&ours["sigma"][name]);
            assert!(off < 0.5, "{set} {camera}: {name} is {off} sigma off");
        }
    }
}

#[test]
fn a_real_pair_comes_to_the_reference_optimum() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    for side in ["left", "right"] {
        let out = file(&format!("{side}.toml"));
        run_json(&[
            "calibrate",
            "intrinsics",
            "--json",
            "--csv",
            &csv,
            "--camera",
            side,
            "--size",
            "960x600",
            "--out",
            &out,
        ]);
    }
    let (left, right, rig) = (file("left.toml"), file("right.toml"), file("rig.toml"));
    let pair =
        ["calibrate", "extrinsics", "--json", "--left", &left, "--right", &right, "--csv", &csv, "--lenses", "free"];
    let stereo = &reference(&folder, "reference_opencv_classic_cv5.json")["stereo"];
    let all = run_json(&[&pair[..], &["--no-loss"]].concat());
    assert!(number(&all["joint"]["rms_px"]) <= 1.001 * number(&stereo["kb4_scipy_ba"]["rms_px"]), "{all}");
    let page = file("report.html");
    let robust = run_json(&[&pair[..], &["--out", &rig, "--report", &page]].concat());
    let html = std::fs::read_to_string(&page).expect("a report");
    assert!(html.contains("<svg") && html.trim_end().ends_with("</html>") && !html.contains("NaN"));
    println!("{robust}");
    let trimmed = &stereo["kb4_scipy_ba_trimmed"];
    assert!(number(&robust["joint"]["rms_inlier_px"]) <= 1.01 * number(&trimmed["rms_px"]), "{robust}");
    // The rig file is one that depth takes.
    let image = |name: &str| folder.join("images").join(name).to_string_lossy().into_owned();
    let (left, right, cloud) = (image("left10.jpg"), image("right10.jpg"), file("cloud.ply"));
    let depth = run_json(&["depth", "--json", "--rig", &rig, "--left", &left, "--right", &right, "--out", &cloud]);
    assert!(number(&depth["points"]) >= 200.0, "{depth}");
}

/// Lenses held, known up to their covariance, and free: the more is open, the less sure is the pose.
#[test]
fn lenses_known_up_to_their_covariance_lie_between_exact_and_free() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let [left, right] = camera_files(&folder, work.path());
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let pair = ["calibrate", "extrinsics", "--json", "--left", &left, "--right", &right, "--csv", &csv, "--lenses"];
    let [exact, known, free] = ["exact", "known", "free"].map(|lenses| run_json(&[&pair[..], &[lenses]].concat()));
    let sigma = |result: &Value| (0..6).map(|i| number(&result["joint"]["sigma"][i]).powi(2)).sum::<f64>();
    println!("{}, {}, {}", exact["joint"], known["joint"], free["joint"]);
    assert!(sigma(&exact) < sigma(&known) && sigma(&known) < sigma(&free));
    // The set's cameras were not triggered together, so that the results differ by more than their sigma.
    for other in [&exact, &known] {
        assert!((number(&other["joint"]["baseline_mm"]) - number(&free["joint"]["baseline_mm"])).abs() < 2.0);
    }
    let rms = |result: &Value| number(&result["joint"]["rms_inlier_px"]);
    assert!(rms(&free) <= rms(&known) * 1.001 && rms(&known) <= rms(&exact) * 1.001);
    // Held-out views are predicted nearly as well.
    let held_out = run_json(&[&pair[..], &["known", "--holdout", "4"]].concat());
    assert!(number(&held_out["held_out"]["rms_px"]) < 1.3 * rms(&known), "{}", held_out["held_out"]["rms_px"]);
    // A camera file that does not say how sure it is.
    let text = std::fs::read_to_string(&left).expect("a camera file");
    let bare = work.path().join("bare.toml").to_string_lossy().into_owned();
    std::fs::write(&bare, text.split("[calibration]").next().expect("a camera")).expect("written");
    let out = work.path().join("rig.toml").to_string_lossy().into_owned();
    let mut arguments = pair.to_vec();
    arguments[4] = &bare;
    fails_with(&[&arguments[..], &["known", "--out", &out]].concat(), 2, &["bare.toml", "covariance"]);
    assert!(!Path::new(&out).exists());
}

/// Unless told otherwise the lenses move as far as their covariance allows, and are held only where there is none.
#[test]
fn lenses_are_known_unless_their_files_carry_no_covariance() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let [left, right] = camera_files(&folder, work.path());
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let calibrate = |left: &str, more: &[&str]| {
        let pair = ["calibrate", "extrinsics", "--json", "--left", left, "--right", &right, "--csv", &csv];
        run_json(&[&pair[..], more].concat())
    };
    let [exact, known] = ["exact", "known"].map(|lenses| calibrate(&left, &["--lenses", lenses]));
    assert_eq!(calibrate(&left, &[])["joint"], known["joint"]);
    // The set's cameras were not triggered together: no lens makes the views agree, and the sentence says so.
    for result in [&exact, &known] {
        println!("scatter {}: {}", result["joint"]["view_scatter"], result["verdict"]["text"]);
        assert!(number(&result["joint"]["view_scatter"]) > 1.3);
        assert!(result["verdict"]["text"].as_str().expect("a sentence").contains("The views disagree"));
    }
    assert!(number(&known["verdict"]["depth_sigma_mm"]) > 1.0 && number(&exact["verdict"]["depth_sigma_mm"]) > 0.5);
    let text = std::fs::read_to_string(&left).expect("a camera file");
    let bare = work.path().join("bare.toml").to_string_lossy().into_owned();
    std::fs::write(&bare, text.split("[calibration]").next().expect("a camera")).expect("written");
    assert_eq!(calibrate(&bare, &[])["joint"], exact["joint"]);
}

/// A small lens past 90°, so that rendering is quick.
fn small_rig() -> String {
    vergence_rig::BENCH_TOML.replace("[1280, 1280]", "[640, 640]").replace("366.0", "183.0").replace("639.5", "319.5")
}

#[test]
fn captured_targets_give_the_simulated_lens_back() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (rig, set, camera, truth) = (file("rig.toml"), file("set"), file("cam.toml"), file("truth.toml"));
    std::fs::write(&rig, small_rig()).expect("a rig file");
    let target = ["--corners", "9x6", "--square", "20mm"];
    let taken = run_json(
        &[
            &["capture", "--json", "--rig", &rig, "--cameras", "sim", "--mono", "--out", &set, "--frames", "120"],
            &target[..],
        ]
        .concat(),
    );
    println!("{taken}");
    assert_eq!(taken["complete"], true, "{taken}");
    let images = format!("{set}/left*.png");
    let found = run_json(
        &[&["calibrate", "intrinsics", "--json", "--images", &images, "--out", &camera], &target[..]].concat(),
    );
    println!("{} px rms, valid to {}°", found["rms_inlier_px"], found["theta_max_deg"]);
    assert!(number(&found["rms_inlier_px"]) < 0.2, "{found}");
    let rig = vergence_rig::Rig::from_toml(&small_rig()).expect("a rig");
    let document = vergence_rig::CameraDocument {
        camera: vergence_rig::CameraTable::of(&rig.left_camera),
        calibration: None,
        provenance: None,
    };
    std::fs::write(&truth, toml::to_string(&document).expect("TOML")).expect("written");
    let off = run_json(&["calibrate", "diff", "--json", &truth, &camera, "--field", "85deg"]);
    println!("{off}");
    assert!(number(&off["median_deg"]) < 0.02 && number(&off["worst_deg"]) < 0.1, "{off}");
}

/// Photographs through a traced lens, by the command line: the calibration finds how it images far points, which is not as the rig's ideal lens
/// does.
#[test]
fn captured_targets_give_the_traced_lens_as_far_as_one_centre_can() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (rig, set, camera) = (file("rig.toml"), file("set"), file("cam.toml"));
    std::fs::write(&rig, small_rig()).expect("a rig file");
    let target = ["--corners", "9x6", "--square", "20mm"];
    let capture = ["capture", "--json", "--rig", &rig, "--cameras", "sim", "--mono", "--lens", "sigma8_f18"];
    let taken = run_json(&[&capture[..], &["--out", &set, "--frames", "120"], &target].concat());
    println!("{taken}");
    assert_eq!(taken["lens"], "sigma8_f18", "{taken}");
    let images = format!("{set}/left*.png");
    let intrinsics = ["calibrate", "intrinsics", "--json", "--images", &images, "--out", &camera];
    let found = run_json(&[&intrinsics[..], &target].concat());
    println!("{} px rms, {} corners", found["rms_inlier_px"], found["corners_total"]);
    assert!(number(&found["rms_inlier_px"]) < 0.25, "{found}");
    let ideal = vergence_rig::Rig::from_toml(&small_rig()).expect("a rig").left_camera;
    let traced = "sigma8_f18".parse::<LensChoice>().expect("a name").in_place_of(&ideal).expect("a lens");
    let text = std::fs::read_to_string(&camera).expect("a camera file");
    let document: vergence_rig::CameraDocument = toml::from_str(&text).expect("a camera");
    let calibrated = document.camera.camera().expect("a lens");
    for deg in [20.0_f64, 50.0, 75.0] {
        let direction = Vector3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos());
        let point: Point<Camera> = Point::from_mm(direction * 1e9);
        let pixel = traced.image_of(&point).expect("in the field");
        let off = |lens: &KannalaBrandt| {
            lens.unproject::<Camera>(pixel).expect("in the field").vector().angle(&direction).to_degrees()
        };
        println!("{deg} degrees: off by {:.3} degrees, the ideal lens by {:.3}", off(&calibrated), off(&ideal));
        assert!(off(&calibrated) < 0.2 && (deg < 40.0 || off(&ideal) > 5.0 * off(&calibrated)));
    }
}

#[test]
fn held_out_views_and_the_verdict_are_told() {
    let Some(folder) = real_data("data/ocam_fisheye1") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let (page, store) = (file("report.html"), file("kept"));
    let arguments = ["calibrate", "intrinsics", "--json", "--csv", &csv, "--size", "1032x778", "--holdout", "5"];
    let more = ["--report", &page, "--fov", "190deg", "--store", &store, "--slot", "front", "--date", "2026-11-21"];
    let result = run_json(&[&arguments[..], &more].concat());
    let (held_out, used) = (number(&result["held_out"]["rms_px"]), number(&result["rms_inlier_px"]));
    println!("{used} px used, {held_out} px held out; {}", result["verdict"]["text"]);
    assert!(held_out > used && held_out < 1.5 * used);
    assert_eq!(result["held_out"]["views"].as_array().map(Vec::len), Some(15));
    let verdict = result["verdict"]["text"].as_str().expect("a sentence");
    assert!(verdict.starts_with("Good to ") && number(&result["verdict"]["depth_sigma_mm"]) > 0.0);
    let html = std::fs::read_to_string(&page).expect("a report");
    assert!(html.contains(verdict) && html.contains("did not see") && html.contains("2026-11-21"));
    let kept = run_json(&["calibrate", "list", "--json", "--store", &store]);
    assert_eq!(kept["calibrations"][0]["name"], "front");
    assert_eq!(kept["calibrations"][0]["kind"], "camera");
}

#[test]
fn camera_files_are_converted_and_applied() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (toml, yaml, chain) = (file("cam.toml"), file("cam.yaml"), file("chain.yaml"));
    std::fs::write(
        &toml,
        "[camera]\nsize = [960, 600]\ntheta_max = \"98deg\"\nfx = 230.0\nfy = 230.0\ncx = 479.5\ncy = 299.5\n\
         opencv_k1 = 0.01\nopencv_k2 = -0.004\nopencv_k3 = 0.001\nopencv_k4 = -0.0002\n",
    )
    .expect("written");
    run_json(&["camera", "convert", "--json", &toml, "--to", "opencv", "--out", &yaml]);
    run_json(&["camera", "convert", "--json", &yaml, "--to", "kalibr", "--out", &chain]);
    let pixels = [&toml, &yaml, &chain].map(|file| run_json(&["camera", "project", "--json", file, "0.9,0.1,-0.1"]));
    // Past 90°: behind the image plane and still seen.
    assert!(pixels[0]["pixels"][0][0].as_f64().expect("a pixel") > 800.0);
    for other in &pixels[1..] {
        let off = number(&other["pixels"][0][0]) - number(&pixels[0]["pixels"][0][0]);
        assert!(off.abs() < 1e-9, "{off}");
    }
    let shown = run_json(&["camera", "show", "--json", &chain]);
    assert!((number(&shown["cameras"][0]["theta_max_deg"]) - 98.0).abs() < 1e-9, "{shown}");
    assert!(run_json(&["camera", "project", "--json", &toml, "0,0,-1"])["pixels"][0].is_null());
    let ray = run_json(&["camera", "unproject", "--json", &toml, "479.5,299.5"]);
    assert!((number(&ray["rays"][0][2]) - 1.0).abs() < 1e-12);
    fails_with(&["camera", "show", &file("missing.yaml")], 2, &["missing.yaml"]);
}

#[test]
fn a_target_is_drawn_in_true_size_or_refused() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let out = work.path().join("target.svg").to_string_lossy().into_owned();
    run_json(&["target", "--json", "--corners", "9x6", "--square", "20mm", "--paper", "A4", "-o", &out]);
    let svg = std::fs::read_to_string(&out).expect("a drawing");
    assert!(svg.contains("width=\"297mm\"") && svg.matches("width=\"20\"").count() == 35);
    fails_with(
        &["target", "--corners", "9x6", "--square", "40mm", "--paper", "A4", "-o", &out],
        2,
        &["A4", "larger sheet"],
    );
}
