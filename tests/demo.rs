//! The main job, end to end: simulated rig, real protocol, both modes, scored against the truth.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;
use std::sync::Arc;

use common::run_json;
use serde_json::Value;
use vergence_rig::{BENCH_TOML, Rig};
use vergence_scene::LensChoice;
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Pixel, Side};

fn demo(lens: &[&str], out: &Path) -> Value {
    run_json(&[&["demo", "--out", out.to_str().expect("a name"), "--json"], lens].concat())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn both_modes_see_what_is_there_and_the_same_seed_gives_the_same_bytes() {
    let folders = [0, 1].map(|_| tempfile::tempdir().expect("a temporary folder"));
    let result = demo(&["--lens", "ideal"], folders[0].path());
    assert_eq!(result["lens"], "ideal");
    assert!(!folders[0].path().join("rig.toml").exists(), "the rig file is that of the command");
    let modes = result["modes"].as_array().expect("modes");
    let names: Vec<_> = modes.iter().map(|mode| mode["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["herbivore", "human"]);
    let stereo = [57.15, 192.66];
    for (mode, stereo) in modes.iter().zip(stereo) {
        println!("{mode}");
        for axis in ["baseline_mm", "separation_deg"] {
            let off = number(&mode["achieved"][axis]) - number(&mode["commanded"][axis]);
            assert!(off.abs() < 0.03, "{axis} is off by {off}");
        }
        assert!((number(&mode["zones_deg"]["stereo"]) - stereo).abs() < 0.1);
        assert!(number(&mode["points"]) >= 300.0);
        assert!(number(&mode["points_within_1500mm"]) >= 100.0);
        assert!(number(&mode["depth_rel_err_within_1500mm"]["median"]) < 0.01);
        assert!(number(&mode["depth_rel_err"]["median"]) < 0.01);
        assert!(number(&mode["outlier_fraction"]) < 0.02);
        // A keypoint without a match is not a match without a point: each count adds up by itself.
        let sum = |what: &str| -> f64 {
            mode["dropped"][what].as_object().expect("counts by reason").values().map(number).sum()
        };
        let [points, matches, keypoints] = ["points", "matches", "keypoints"].map(|what| number(&mode[what]));
        let (dropped_keypoints, dropped_matches) = (sum("keypoints"), sum("matches"));
        assert!((points + dropped_matches - matches).abs() < 0.5, "{points} + {dropped_matches} of {matches}");
        assert!(
            (matches + dropped_keypoints - keypoints).abs() < 0.5,
            "{matches} + {dropped_keypoints} of {keypoints}"
        );
    }
    demo(&["--seed", "1", "--lens", "ideal"], folders[1].path());
    let drawing = std::fs::read_to_string(folders[0].path().join("herbivore-matches.svg")).expect("a drawing");
    let (points, matches) = (&modes[0]["points"], &modes[0]["matches"]);
    assert!(drawing.contains(&format!("range of {points} points of {matches} matches")), "counts as in the table");
    assert_eq!(drawing.matches("<circle").count() as u64, 2 * points.as_u64().expect("a count"));
    let files = ["herbivore.ply", "human.ply", "herbivore-left.png", "human-right.png"];
    let drawings = ["herbivore-matches.svg", "human-depth.svg", "human-error.svg"];
    for file in files.into_iter().chain(drawings) {
        let [first, second] = folders.each_ref().map(|folder| std::fs::read(folder.path().join(file)).expect(file));
        assert!(first == second, "{file} differs between two runs with the same seed");
    }
}

/// Unless others are asked for, a published design is in the place of the drawing's lenses: its pupil moves. The rig is calibrated from targets first, and measured by the file that this
/// writes, here and by 'depth' with the same images.
#[test]
fn traced_lenses_are_measured_by_the_file_of_their_calibration() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let result = demo(&[], folder.path());
    assert_eq!(result["lens"], "sigma8_f18");
    for mode in result["modes"].as_array().expect("modes") {
        println!("{mode}");
        assert!(number(&mode["points"]) >= 300.0 && number(&mode["depth_rel_err"]["median"]) < 0.005, "{mode}");
        assert!(number(&mode["outlier_fraction"]) < 0.02, "{mode}");
        off_the_truth(mode, &file);
    }
}

/// Measures the images of a mode by the file, and compares the points with what the traced lens truly showed.
fn off_the_truth(mode: &Value, file: &dyn Fn(&str) -> String) {
    let name = mode["name"].as_str().expect("a name");
    let axes = ["baseline_mm", "separation_deg"].map(|axis| number(&mode["achieved"][axis]));
    let (baseline, separation) = (format!("{}mm", axes[0]), format!("{}deg", axes[1]));
    let (rig, cloud) = (file("rig.toml"), file("again.ply"));
    let (left, right) = (file(&format!("{name}-left.png")), file(&format!("{name}-right.png")));
    let stand = ["--baseline", &baseline, "--separation", &separation, "--left", &left, "--right", &right];
    let again = run_json(&[&["--rig", &rig, "depth", "--json", "--out", &cloud, "--also", "csv"], &stand[..]].concat());
    let again_points = number(&again["pairs"].get(0).unwrap_or(&again)["points"]);
    assert!((again_points / number(&mode["points"]) - 1.0).abs() < 0.05, "{again_points} points, {mode}");

    let known = Rig::from_toml(&std::fs::read_to_string(&rig).expect("the rig file")).expect("a rig");
    assert!(!known.left_camera.is_central() && !known.right_camera.is_central(), "its pupils move");
    let drawn = Rig::from_toml(BENCH_TOML).expect("the bench");
    let lens = "sigma8_f18".parse::<LensChoice>().expect("a lens").in_place_of(&drawn.left_camera).expect("a lens");
    let camera = RoomCamera { side: Side::Left, lens, room: Arc::new(Room::with_rig()), seed: 0 };
    let pose = drawn.pose_at_values(&[axes[0], axes[1].to_radians()]);
    let table = std::fs::read_to_string(file("again.csv")).expect("a table");
    let mut sizes = Vec::new();
    for line in table.lines().skip(1) {
        let n: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
        let Some(truth) = camera.true_range(&pose, Pixel { u: n[6], v: n[7] }) else { continue };
        let range = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        sizes.push(((range - truth.mm()) / n[10]).abs());
    }
    sizes.sort_by(f64::total_cmp);
    let within = sizes.iter().filter(|size| **size < 3.0).count() as f64 / sizes.len() as f64;
    let middle = sizes[sizes.len() / 2];
    println!("{name}: {} points, half within {middle:.2} sigma, {within:.3} within three", sizes.len());
    assert!(middle < 1.2 && within > 0.9, "{name}: {middle} {within}");
}
