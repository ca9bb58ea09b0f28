//! The robot's rig file on the command line: zones, paths between modes, goals.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod common;

use common::{fails_with, run, run_json, text};

const RIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rigs/origaker.toml");

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Exact zones on the paper's circle of 3 m, worked out for a baseline of 145 mm, and what the paper prints.
#[test]
fn zones_stand_beside_the_printed_ones() {
    for (mode, printed, exact) in [("gecko", 76.0, 73.77), ("spider", 136.0, 134.91), ("stick-bug", 140.0, 156.53)] {
        let zones = run_json(&["zones", "--rig", RIG, "--mode", mode, "--json"]);
        assert_eq!(zones["trunk"]["near_dead_centre"], mode == "gecko", "{zones}");
        assert!(number(&zones["trunk"]["missed_sigma"]) < 1e-3, "{zones}");
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

/// Near gecko the joints tell little of the pose, and every verb that uses it says so.
#[test]
fn a_dead_centre_is_told() {
    let said = |arguments: &[&str]| text(&run(arguments).stdout);
    let near = "near a dead centre of the trunk: its joints alone tell the pose to";
    for mode in ["gecko", "spider"] {
        assert_eq!(said(&["zones", "--rig", RIG, "--mode", mode]).contains(near), mode == "gecko");
        let from = if mode == "gecko" { "spider" } else { "gecko" };
        assert_eq!(said(&["plan", mode, "--rig", RIG, "--from", from]).contains(near), mode == "gecko");
    }
    let plan = run_json(&["plan", "gecko", "--rig", RIG, "--from", "spider", "--json"]);
    assert!(number(&plan["trunk"]["joints_tell"]["rotation_deg"]) > 1.0, "{plan}");
}

/// The robot's story, as anybody plays it: a simulated robot whose controller moves its joints.
#[test]
fn the_robot_searches_passes_and_inspects() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("a name");
    let story = run_json(&["demo", "--rig", RIG, "--out", out, "--json"]);
    let list = |value: &serde_json::Value| value.as_array().expect("a list").clone();
    let modes = list(&story["modes"]);
    assert_eq!(
        modes.iter().map(|mode| mode["name"].as_str()).collect::<Vec<_>>(),
        ["gecko", "spider", "stick-bug"].map(Some)
    );
    for station in modes.iter().flat_map(|mode| list(&mode["stations"])) {
        let near = number(&station["depth_rel_err_within_1500mm"]["median"]);
        assert!(near < 0.02 && number(&station["points"]) > 100.0, "{station}");
        assert_eq!(station["pose"]["from"], "joints and images", "{station}");
        // The truth is that of the simulated trunk, not of its encoders.
        let [joints, pose] = ["joints_off", "pose_off"].map(|which| number(&station[which]["rotation_deg"]));
        assert!(joints > 1e-3 && pose < 0.1, "{station}");
        for side in ["left", "right"] {
            // Gecko and stick-bug have no walls.
            let error = station["walls_mm"][side]["error"].as_f64();
            assert!(error.is_none_or(|error| error.abs() < 10.0), "{side} wall: {station}");
        }
    }
    assert!(modes[1]["stations"][0]["walls_mm"]["left"]["measured"].is_number());
    // The controller takes what was planned, and the settling of the joints.
    let changes = list(&story["changes"]);
    assert_eq!(changes.len(), 3, "{changes:?}");
    for change in changes {
        let (took, planned) = (number(&change["seconds"]), number(&change["planned_s"]));
        assert!(took > planned && took < planned + 0.6, "{change}");
    }
    // One eye finds the target; both measure it.
    let found = &story["found"];
    assert_eq!(found["target_seen_by"], "left");
    assert!(number(&found["target_bearing_error_deg"]).abs() < 0.5, "{found}");
    assert!(number(&found["target_range_error_mm"]).abs() < 3.0, "{found}");
    for file in [
        "spider-to-gecko.svg",
        "gecko-to-spider.svg",
        "spider-to-stick-bug.svg",
        "0-gecko.ply",
        "6-stick-bug-matches.svg",
    ] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
    let map = std::fs::read_to_string(folder.path().join("corridor.svg")).expect("a map");
    // Ten parcels, and a number for each of seven stations.
    assert_eq!([map.matches("<polygon").count(), map.matches("r=\"11\"").count()], [10, 7]);
}

/// Folded shapes: planned, drawn, driven by the simulated board, and refused where bodies would touch.
#[test]
fn a_folded_mode_is_planned_drawn_and_reached() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let mode = |name: &str, number: u32, corners: [u32; 2], folds: u32| {
        let [corner, side] = corners;
        format!(
            "[modes.{name}]\nnumber = {number}\nfront_corner = \"{corner}deg\"\nrear_corner = \"{corner}deg\"\n\
             side_joint = \"{side}deg\"\nrear_fold = \"{folds}deg\"\nfront_fold = \"{folds}deg\"\n"
        )
    };
    let modes = mode("folded", 4, [120, 120], 90) + &mode("slim", 5, [140, 80], 100) + &mode("mammal", 6, [90, 180], 0);
    let robot =
        std::fs::read_to_string(RIG).expect("the robot's file").replace("[trunk]", &format!("{modes}\n[trunk]"));
    let (rig, strip) = (file("robot.toml"), file("strip.svg"));
    std::fs::write(&rig, robot).expect("a rig file");

    let plan = run_json(&["plan", "folded", "--rig", &rig, "--from", "gecko", "--strip", &strip, "--json"]);
    let legs = plan["legs"].as_array().expect("legs");
    assert!(legs.len() == 3 && number(&plan["kept"]["reserve_deg"]) >= 0.999, "{plan}");
    let ends: Vec<f64> = legs.iter().map(|leg| number(&leg["to"]["rear_fold_deg"])).collect();
    assert_eq!(ends, [180.0, 180.0, 90.0], "gecko bends before it folds");
    assert!(std::fs::read_to_string(&strip).expect("a strip").contains("folds 90°"));
    let table = text(&run(&["plan", "slim", "--rig", &rig, "--from", "folded", "--dump"]).stdout);
    assert!(
        table.contains("folds 100.0") && table.lines().any(|line| line.trim_end().ends_with("22.58    11.0")),
        "{table}"
    );
    fails_with(
        &["plan", "mammal", "--rig", &rig, "--from", "gecko"],
        1,
        &["left camera and the right camera overlap by 16.0 mm"],
    );

    let reached = run_json(&["mode", "folded", "--rig", &rig, "--port", "sim", "--json"]);
    assert_eq!(reached["mode"], "folded", "{reached}");
    for (axis, to) in [("rear_fold_deg", 90.0), ("front_fold_deg", 90.0), ("side_joint_deg", 120.0)] {
        assert!((number(&reached["achieved"][axis]) - to).abs() < 0.5, "{reached}");
    }
}

#[test]
fn a_goal_finds_a_shape_of_the_trunk() {
    let found = run_json(&["plan", "--rig", RIG, "--goal", "sigma_z <= 20mm at 500mm over +-20deg", "--json"]);
    assert_eq!(found["meets_goal"], true, "{found}");
    let [side, corner] = ["side_joint_deg", "front_corner_deg"].map(|axis| number(&found["pose"][axis]));
    assert!((corner - (180.0 - side / 2.0)).abs() < 1e-4, "both sides are alike, to the digits printed: {found}");
    let said = text(&run(&["plan", "--rig", RIG, "--goal", "sigma_z <= 20mm at 500mm over +-30deg"]).stdout);
    assert!(said.starts_with("sigma_z <= 20 mm at 500 mm over ±30°, for matches good to 0.1 px:"), "{said}");
}
