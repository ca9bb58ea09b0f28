//! Calibration by the command line: other programs' corners, the program's own, and what bad input is told.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::{fails_with, run_json, shared};
use serde_json::Value;

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
        let Some(folder) = shared(&format!("data/{set}")) else { return };
        let csv = folder.join(corners).to_string_lossy().into_owned();
        let mut arguments = vec!["calibrate", "intrinsics", "--json", "--corners", &csv, "--size", size];
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
    let Some(folder) = shared("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    for side in ["left", "right"] {
        let out = file(&format!("{side}.toml"));
        run_json(&[
            "calibrate",
            "intrinsics",
            "--json",
            "--corners",
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
    let pair = [
        "calibrate",
        "extrinsics",
        "--json",
        "--left",
        &left,
        "--right",
        &right,
        "--corners",
        &csv,
        "--lenses",
        "free",
    ];
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

/// The camera files of both cameras of the stereo set, from its corners.
fn camera_files(folder: &Path, work: &Path) -> [String; 2] {
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    ["left", "right"].map(|side| {
        let out = work.join(format!("{side}.toml")).to_string_lossy().into_owned();
        let from = ["--corners", &csv, "--camera", side, "--size", "960x600"];
        run_json(&[&["calibrate", "intrinsics", "--json", "--out", &out], &from[..]].concat());
        out
    })
}

/// Lenses held, known up to their covariance, and free: the more is open, the less sure is the pose.
#[test]
fn lenses_known_up_to_their_covariance_lie_between_exact_and_free() {
    let Some(folder) = shared("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let [left, right] = camera_files(&folder, work.path());
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let pair = ["calibrate", "extrinsics", "--json", "--left", &left, "--right", &right, "--corners", &csv, "--lenses"];
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

/// What a pair is told of cameras and corners that cannot be used.
#[test]
fn bad_pairs_are_refused_and_leave_no_file() {
    let Some(folder) = shared("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let [left, right] = camera_files(&folder, work.path());
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let (out, page, bad) = (file("rig.toml"), file("report.html"), file("bad.toml"));
    let refused = |cameras: [&str; 2], csv: &str, more: &[&str], code: i32, words: &[&str]| {
        let pair = ["calibrate", "extrinsics", "--left", cameras[0], "--right", cameras[1], "--corners", csv];
        fails_with(&[&pair[..], &["--out", &out, "--report", &page], more].concat(), code, words);
        assert!(!Path::new(&out).exists() && !Path::new(&page).exists());
    };
    let text = std::fs::read_to_string(&left).expect("a camera file");
    let line = |key: &str| text.lines().find(|line| line.starts_with(key)).expect("a key").to_owned();
    std::fs::write(&bad, text.replace(&line("opencv_k1"), "opencv_k1 = -0.9")).expect("written");
    refused([&bad, &right], &csv, &[], 2, &["bad.toml", "turns over"]);
    std::fs::write(&bad, text.replace(&line("fx"), "fx = nan")).expect("written");
    refused([&bad, &right], &csv, &[], 2, &["bad.toml"]);
    refused([&left, &file("none.toml")], &csv, &[], 2, &["none.toml"]);
    refused([&left, &right], &csv, &["--cameras", "left", "top"], 2, &["top", "left, right"]);
    let rows = std::fs::read_to_string(&csv).expect("corners");
    let (few, wild) = (file("few.csv"), file("wild.csv"));
    let header = rows.lines().next().expect("a header");
    let of_frame = |frame: &str| rows.lines().filter(|row| row.split(',').nth(2) == Some(frame)).collect::<Vec<_>>();
    std::fs::write(&few, [&[header], &of_frame("1")[..]].concat().join("\n")).expect("written");
    refused([&left, &right], &few, &[], 2, &["1 views", "3"]);
    // The right camera's corners in another order: good data that nothing fits.
    let shuffled: Vec<String> = rows
        .lines()
        .map(|row| match row.strip_prefix("right,") {
            Some(rest) => {
                let cells: Vec<&str> = rest.split(',').collect();
                let index: usize = cells[2].parse().expect("an index");
                let other = (index * 7 + 3) % 54;
                let (x, y) = (24.23 * (other % 9) as f64, 24.23 * (other / 9) as f64);
                format!("right,{},{},{index},{},{},{x},{y}", cells[0], cells[1], cells[3], cells[4])
            }
            None => row.to_owned(),
        })
        .collect();
    std::fs::write(&wild, shuffled.join("\n")).expect("written");
    let output = common::run(&[
        "calibrate",
        "extrinsics",
        "--left",
        &left,
        "--right",
        &right,
        "--corners",
        &wild,
        "--out",
        &out,
    ]);
    let said = common::text(&output.stderr);
    println!("{said}");
    assert!(matches!(output.status.code(), Some(1 | 2)) && said.lines().count() == 1, "{said}");
    assert!(!Path::new(&out).exists());
}

/// A small lens past 90°, so that rendering is quick.
fn small_rig() -> String {
    vergence_rig::BENCH_TOML.replace("[1280, 1280]", "[640, 640]").replace("366.0", "183.0").replace("639.5", "319.5")
}

#[test]
fn captured_boards_give_the_simulated_lens_back() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (rig, set, camera, truth) = (file("rig.toml"), file("set"), file("cam.toml"), file("truth.toml"));
    std::fs::write(&rig, small_rig()).expect("a rig file");
    let board = ["--board", "9x6", "--square", "20mm"];
    let taken = run_json(
        &[
            &["capture", "--json", "--rig", &rig, "--cameras", "sim", "--mono", "--out", &set, "--frames", "120"],
            &board[..],
        ]
        .concat(),
    );
    println!("{taken}");
    assert_eq!(taken["complete"], true, "{taken}");
    let images = format!("{set}/left*.png");
    let found =
        run_json(&[&["calibrate", "intrinsics", "--json", "--images", &images, "--out", &camera], &board[..]].concat());
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

/// Corners of a board that is seen from straight ahead, at `distances`.
fn frontal_csv(distances: &[f64]) -> String {
    let mut csv = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    for (frame, distance) in distances.iter().enumerate() {
        for index in 0..54u32 {
            let (x, y) = (f64::from(index % 9) * 20.0, f64::from(index / 9) * 20.0);
            let (u, v) = (480.0 + 230.0 * (x - 80.0) / distance, 300.0 + 230.0 * (y - 50.0) / distance);
            csv += &format!("cam,view{frame}.png,{frame},{index},{u},{v},{x},{y}\n");
        }
    }
    csv
}

#[test]
fn bad_corners_are_refused_and_leave_no_file() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (csv, out) = (file("corners.csv"), file("cam.toml"));
    let several = frontal_csv(&[300.0, 350.0, 400.0, 500.0]);
    let cases = [
        (frontal_csv(&[300.0]), "1 view"),
        (several.clone(), "parallel"),
        (several.replacen(",0,480", ",0,NaN", 1).replacen("view0.png,0,0,", "view0.png,0,0,NaN", 1), "corners.csv"),
        (format!("{several}{}", several.lines().nth(1).expect("a row")), "same place"),
        ("camera,file,frame,idx,x,y\n".to_owned(), "corners"),
        ("nothing".to_owned(), "corners"),
    ];
    for (text, word) in cases {
        std::fs::write(&csv, text).expect("written");
        let arguments = ["calibrate", "intrinsics", "--corners", &csv, "--size", "960x600", "--out", &out];
        fails_with(&arguments, 2, &[word]);
        assert!(!Path::new(&out).exists());
    }
    std::fs::write(&csv, several).expect("written");
    fails_with(&["calibrate", "intrinsics", "--corners", &csv, "--size", "960", "--out", &out], 2, &["960x600"]);
    fails_with(
        &["calibrate", "intrinsics", "--corners", &csv, "--size", "960x600", "--camera", "front"],
        2,
        &["front", "cam"],
    );
    fails_with(
        &["calibrate", "intrinsics", "--images", "/nowhere/*.png", "--board", "9x6", "--square", "20mm"],
        2,
        &["/nowhere"],
    );
    fails_with(
        &["capture", "--cameras", "/dev/none", "--board", "9x6", "--square", "20mm", "--out", &file("set")],
        3,
        &["/dev/none"],
    );
}

#[test]
fn images_without_a_board_or_of_two_sizes_are_told() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let grey = |name: &str, width| {
        image::RgbImage::from_pixel(width, 200, image::Rgb([90; 3])).save(file(name)).expect("a picture");
    };
    grey("a0.png", 300);
    grey("a1.png", 300);
    let board = ["--board", "9x6", "--square", "20mm"];
    let pattern = file("a*.png");
    let arguments = [&["calibrate", "intrinsics", "--images", &pattern], &board[..]].concat();
    fails_with(&arguments, 2, &["no board", "2 images"]);
    grey("a2.png", 310);
    fails_with(&arguments, 2, &["a2.png", "310 x 200"]);
}

/// A chessboard of `columns` x `rows` inner corners, seen from straight ahead.
fn chessboard(path: &str, columns: u32, rows: u32) {
    let square = |x: u32, y: u32| (x / 30 + y / 30).is_multiple_of(2);
    let picture = image::RgbImage::from_fn(30 * (columns + 5), 30 * (rows + 5), |x, y| {
        let inside = (60..60 + 30 * (columns + 1)).contains(&x) && (60..60 + 30 * (rows + 1)).contains(&y);
        image::Rgb([if inside && square(x, y) { 20 } else { 230 }; 3])
    });
    image::imageops::blur(&picture, 0.8).save(path).expect("a picture");
}

#[test]
fn a_board_of_another_size_is_told() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    for name in ["a0.png", "a1.png"] {
        chessboard(&file(name), 11, 8);
    }
    let (pattern, out) = (file("a*.png"), file("cam.toml"));
    let arguments = ["calibrate", "intrinsics", "--images", &pattern, "--square", "20mm", "--out", &out, "--board"];
    fails_with(&[&arguments[..], &["7x5"]].concat(), 2, &["11 × 8", "7 × 5"]);
    // The right size, but the same frontal view twice.
    fails_with(&[&arguments[..], &["11x8"]].concat(), 2, &["no calibration"]);
    assert!(!Path::new(&out).exists());
}

/// Corners that are there, but nowhere near a board: the data can be read and the result is no good.
#[test]
fn a_fit_that_fails_its_own_check_is_exit_code_1() {
    let Some(folder) = shared("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let rows = std::fs::read_to_string(folder.join("corners_opencv_classic.csv")).expect("corners");
    let shaken: Vec<String> = rows
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            if line > 0 {
                for (cell, stride) in [(4, 37), (5, 61)] {
                    let shift = (line * stride % 41) as f64 - 20.0;
                    cells[cell] = format!("{}", cells[cell].parse::<f64>().expect("a number") + shift * 0.6);
                }
            }
            cells.join(",")
        })
        .collect();
    let (csv, out, page) = (file("shaken.csv"), file("cam.toml"), file("report.html"));
    std::fs::write(&csv, shaken.join("\n")).expect("written");
    let arguments = ["calibrate", "intrinsics", "--corners", &csv, "--camera", "left", "--size", "960x600"];
    fails_with(&[&arguments[..], &["--out", &out, "--report", &page]].concat(), 1, &["px off"]);
    assert!(!Path::new(&out).exists() && !Path::new(&page).exists());
}

#[test]
fn held_out_views_and_the_verdict_are_told() {
    let Some(folder) = shared("data/ocam_fisheye1") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let (page, store) = (file("report.html"), file("kept"));
    let arguments = ["calibrate", "intrinsics", "--json", "--corners", &csv, "--size", "1032x778", "--holdout", "5"];
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
    let out = work.path().join("board.svg").to_string_lossy().into_owned();
    run_json(&["target", "--json", "--board", "9x6", "--square", "20mm", "--paper", "A4", "-o", &out]);
    let svg = std::fs::read_to_string(&out).expect("a drawing");
    assert!(svg.contains("width=\"297mm\"") && svg.matches("width=\"20\"").count() == 35);
    fails_with(
        &["target", "--board", "9x6", "--square", "40mm", "--paper", "A4", "-o", &out],
        2,
        &["A4", "larger sheet"],
    );
}
