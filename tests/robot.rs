//! The robot's rig file on the command line: zones, paths between modes, goals.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod common;

use common::{fails_with, run_json};

const RIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rigs/origaker.toml");

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Exact zones on the paper's circle of 3 m, worked out for a baseline of 145 mm, and what the paper prints.
#[test]
fn zones_stand_beside_the_printed_ones() {
    for (mode, printed, exact) in [("gecko", 76.0, 73.77), ("spider", 136.0, 134.91), ("stick-bug", 140.0, 156.53)] {
        let zones = run_json(&["zones", "--rig", RIG, "--mode", mode, "--json"]);
        assert!((number(&zones["published"]["stereo"]) - printed).abs() < 1e-6, "{zones}");
        // The robot's baselines are 150, 193 and 207 mm.
        assert!((number(&zones["published"]["exact"]["stereo"]) - exact).abs() < 0.6, "{zones}");
    }
}

#[test]
fn a_path_between_modes_is_planned_and_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let strip = folder.path().join("strip.svg").to_string_lossy().into_owned();
    let plan = run_json(&["plan", "spider", "--rig", RIG, "--from", "gecko", "--strip", &strip, "--json"]);
    let legs = plan["legs"].as_array().expect("legs");
    assert_eq!(legs.len(), 2, "gecko is left by a leg of its own: {plan}");
    assert!(number(&legs[1]["least_reserve_deg"]) >= 1.0 && number(&plan["kept"]["reserve_deg"]) >= 0.999, "{plan}");
    assert!((number(&plan["to"]["side_joint_deg"]) - 120.0).abs() < 1e-6, "{plan}");
    let svg = std::fs::read_to_string(&strip).expect("a strip");
    assert!(svg.matches("<polygon").count() == 6 && svg.trim_end().ends_with("</svg>"));
    let wide = run_json(&["plan", "stick-bug", "--rig", RIG, "--from", "spider", "--reserve", "30deg", "--json"]);
    assert!(number(&wide["kept"]["reserve_deg"]) < 30.0, "nothing has that much: {wide}");
    fails_with(&["plan", "spider", "--rig", RIG], 2, &["--from"]);
    fails_with(&["plan", "dog", "--rig", RIG, "--from", "gecko"], 2, &["no mode 'dog'", "spider"]);
}

#[test]
fn a_goal_finds_a_shape_of_the_trunk() {
    let found = run_json(&["plan", "--rig", RIG, "--goal", "sigma_z <= 20mm at 500mm over +-20deg", "--json"]);
    assert_eq!(found["meets_goal"], true, "{found}");
    let [side, corner] = ["side_joint_deg", "front_corner_deg"].map(|axis| number(&found["pose"][axis]));
    assert!((corner - (180.0 - side / 2.0)).abs() < 1e-6, "both sides are alike: {found}");
}

#[test]
fn what_knows_no_trunk_says_so() {
    fails_with(&["sim", "--rig", RIG], 2, &["has a trunk"]);
}
