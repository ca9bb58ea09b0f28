//! A camera and a pair calibrated by the command line from targets that say which corner is which: a grid of AprilTags that a file
//! of Kalibr's describes, and a ChArUco board.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use common::{fails_with, run_json};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_rig::{CameraDocument, CameraTable, Rig};

const GRID: &str = "target_type: 'aprilgrid' #gridtype\ntagCols: 4 #number of apriltags\ntagRows: 3\ntagSize: 0.045 #[m]\ntagSpacing: 0.3\n";

/// A small lens past 90°, so that rendering is quick.
fn small_rig() -> String {
    vergence_rig::BENCH_TOML.replace("[1280, 1280]", "[640, 640]").replace("366.0", "183.0").replace("639.5", "319.5")
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|number| number.as_f64().expect("a number")).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

const BOARD: [&str; 8] = ["--charuco", "6x5", "--square", "50mm", "--marker", "34mm", "--dictionary", "DICT_5X5_50"];

#[test]
fn a_simulated_lens_comes_back_within_its_stated_sigma() {
    let work = tempfile::tempdir().expect("a folder");
    let grid = work.path().join("aprilgrid.yaml").to_string_lossy().into_owned();
    std::fs::write(&grid, GRID).expect("a target file");
    lens_comes_back(&["--target", &grid], "4 × 3 AprilTags of 45 mm, spacing 0.3");
    lens_comes_back(&BOARD, "ChArUco board of 6 × 5 squares, 50 mm, markers DICT_5X5_50 of 34 mm");
}

fn lens_comes_back(target: &[&str], described: &str) {
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (rig, set, page) = (file("rig.toml"), file("set"), file("report.html"));
    std::fs::write(&rig, small_rig()).expect("a rig file");
    let capture = ["capture", "--json", "--rig", &rig, "--cameras", "sim", "--mono", "--out", &set, "--frames", "120"];
    let taken = run_json(&[&capture[..], target].concat());
    assert_eq!(taken["complete"], true, "{taken}");
    let images = format!("{set}/left*.png");
    let calibrate = ["calibrate", "intrinsics", "--json", "--images", &images, "--report", &page];
    let found = run_json(&[&calibrate[..], target].concat());
    let truth = Rig::from_toml(&small_rig()).expect("a rig").left_camera.to_opencv();
    let truth = [truth.fx, truth.fy, truth.cx, truth.cy, truth.k[0], truth.k[1], truth.k[2], truth.k[3]];
    println!("{} views, {} px rms, valid to {}°", taken["views"], found["rms_inlier_px"], found["theta_max_deg"]);
    for (name, truth) in ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"].into_iter().zip(truth) {
        let off = (number(&found["opencv"][name]) - truth) / number(&found["sigma"][name]);
        println!("{name}: {} is {off:.2} sigma off", found["opencv"][name]);
        assert!(off.abs() < 4.0, "{name} is {off} sigma off");
    }
    assert!(number(&found["rms_inlier_px"]) < 0.1 && number(&found["theta_max_deg"]) > 92.0, "{found}");
    let html = std::fs::read_to_string(&page).expect("a report");
    assert!(html.contains(described));
}

#[test]
fn a_simulated_pair_comes_back_within_its_stated_sigma() {
    pair_comes_back(&["--tags", "4x3", "--tag", "45mm"]);
    pair_comes_back(&BOARD);
}

fn pair_comes_back(target: &[&str]) {
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (rig, set, lens) = (file("rig.toml"), file("set"), file("lens.toml"));
    std::fs::write(&rig, small_rig()).expect("a rig file");
    let capture = ["capture", "--json", "--rig", &rig, "--cameras", "sim", "--out", &set, "--views", "12"];
    run_json(&[&capture[..], target].concat());
    let rig = Rig::from_toml(&small_rig()).expect("a rig");
    let camera = CameraDocument { camera: CameraTable::of(&rig.left_camera), calibration: None, provenance: None };
    std::fs::write(&lens, toml::to_string(&camera).expect("TOML")).expect("written");
    let (left, right) = (format!("{set}/left*.png"), format!("{set}/right*.png"));
    let pair = ["calibrate", "extrinsics", "--json", "--left", &lens, "--right", &lens, "--left-images", &left];
    let found = run_json(&[&pair[..], &["--right-images", &right], target].concat());
    let human: Vec<f64> = rig.mode("human").expect("a mode").targets.iter().map(|target| target.value()).collect();
    let truth = rig.pose_at_values(&human).left_from_right;
    let joint = &found["joint"];
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from_vec(numbers(&joint["rotation_vector"])));
    let turn = (turn * truth.rotation().inverse()).scaled_axis();
    let shift = Vector3::from_vec(numbers(&joint["translation_mm"])) - truth.origin().mm();
    println!("off by {} mm and {}°, {} px", shift.norm(), turn.norm().to_degrees(), joint["rms_px"]);
    for ((off, sigma), name) in turn.iter().chain(shift.iter()).zip(numbers(&joint["sigma"])).zip(0..) {
        println!("component {name}: {:.2} sigma off", off / sigma);
        assert!(off.abs() < 4.0 * sigma, "component {name} of the pose is {off}, sigma {sigma}");
    }
    assert_eq!(found["left_out"], Value::Array(Vec::new()));
    assert!(shift.norm() < 0.5, "{found}");
}

#[test]
fn a_grid_is_drawn_in_true_size_or_refused() {
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (grid, svg, pdf) = (file("aprilgrid.yaml"), file("grid.svg"), file("grid.pdf"));
    std::fs::write(&grid, GRID).expect("a target file");
    run_json(&["target", "--json", "--target", &grid, "--paper", "A3", "--out", &svg]);
    let drawing = std::fs::read_to_string(&svg).expect("a drawing");
    // Five by four small squares of 13.5 mm, and the ruler.
    assert_eq!(drawing.matches("width=\"13.5\" height=\"13.5\"").count(), 20);
    assert!(drawing.contains("width=\"100\"") && drawing.contains("4 x 3 AprilTags of 45 mm"));
    run_json(&[
        "target",
        "--json",
        "--tags",
        "4x3",
        "--tag",
        "45mm",
        "--tag-spacing",
        "0.3",
        "--paper",
        "A3",
        "--out",
        &pdf,
    ]);
    assert!(std::fs::read(&pdf).expect("a drawing").starts_with(b"%PDF-1.4"));
    fails_with(
        &["target", "--tags", "6x6", "--tag", "88mm", "--out", &svg],
        2,
        &["AprilTags of 88 mm", "larger sheet"],
    );
    fails_with(&["target", "--tags", "6x6", "--out", &svg], 2, &["--tag"]);
    fails_with(&["target", "--tags", "60x60", "--tag", "1mm", "--out", &svg], 2, &["587"]);
    fails_with(&["target", "--tags", "6x6", "--tag", "0mm", "--out", &svg], 2, &["positive"]);
    fails_with(
        &["target", "--tags", "6x6", "--tag", "9mm", "--tag-spacing", "0", "--out", &svg],
        2,
        &["--tag-spacing"],
    );
    fails_with(&["target", "--tags", "6x6", "--tag", "9mm", "--corners", "9x6", "--out", &svg], 2, &["cannot be used"]);
    fails_with(&["target", "--target", &svg, "--out", &pdf], 2, &["grid.svg", "target_type"]);
    let nothing = ["calibrate", "intrinsics", "--images", &svg, "--target", &file("none.yaml")];
    fails_with(&nothing, 2, &["none.yaml"]);
}

#[test]
fn a_charuco_board_is_drawn_in_true_size_or_refused() {
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (svg, pdf) = (file("board.svg"), file("board.pdf"));
    let board = ["target", "--json", "--charuco", "9x6", "--square", "24mm"];
    let drawn = |more: &[&str]| run_json(&[&board[..], more].concat());
    drawn(&["--marker", "18mm", "--out", &svg]);
    let drawing = std::fs::read_to_string(&svg).expect("a drawing");
    // 27 of the 54 squares are black, and the upper and lower border of each of 27 markers of six cells.
    assert_eq!(drawing.matches("width=\"24\" height=\"24\"").count(), 27);
    assert!(drawing.matches("width=\"18\" height=\"3\"").count() >= 54);
    assert!(drawing.contains("ChArUco board of 9 x 6 squares, 24 mm, markers DICT_4X4_50 of 18 mm;"));
    let sheet = drawn(&["--marker", "18mm", "--dictionary", "DICT_7X7_1000", "--legacy-pattern", "--out", &pdf]);
    assert!(sheet["target"].as_str().is_some_and(|target| target.ends_with("DICT_7X7_1000 of 18 mm, legacy pattern")));
    assert!(std::fs::read(&pdf).expect("a drawing").starts_with(b"%PDF-1.4"));
    let refused = |more: &[&str], words: &[&str]| {
        let words_of_it = [&["target", "--out", &svg][..], more].concat();
        fails_with(&words_of_it, 2, words);
    };
    refused(&["--charuco", "9x6", "--square", "24mm"], &["--marker"]);
    refused(&["--charuco", "9x6", "--square", "24mm", "--marker", "24mm"], &["less than --square"]);
    refused(&["--charuco", "9x6", "--square", "0mm", "--marker", "0mm"], &["positive"]);
    refused(&["--charuco", "11x10", "--square", "20mm", "--marker", "9mm"], &["DICT_4X4_50 has 50", "this board 55"]);
    refused(&["--charuco", "2x6", "--square", "20mm", "--marker", "9mm"], &["3x3"]);
    refused(
        &["--charuco", "9x6", "--square", "20mm", "--marker", "9mm", "--dictionary", "DICT_3X3_50"],
        &["DICT_4X4_50", "6X6"],
    );
    refused(&["--charuco", "9x6", "--square", "24mm", "--marker", "18mm", "--corners", "9x6"], &["cannot be used"]);
    refused(&["--corners", "9x6", "--square", "24mm", "--marker", "18mm"], &["--charuco"]);
}
