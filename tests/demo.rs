//! The main job, end to end: simulated rig, real protocol, both modes, scored against the truth.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::run_json;
use serde_json::Value;

fn demo(seed: &str, out: &Path) -> Value {
    run_json(&["demo", "--seed", seed, "--out", out.to_str().expect("a name"), "--json"])
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn both_modes_see_what_is_there_and_the_same_seed_gives_the_same_bytes() {
    let folders = [0, 1].map(|_| tempfile::tempdir().expect("a temporary folder"));
    let result = demo("1", folders[0].path());
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
    demo("1", folders[1].path());
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
