//! The robot's story in the simulated corridor.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::time::Duration;

use serde_json::Value;
use vergence_reproduce::corridor::{Corridor, Story};
use vergence_rig::Rig;

const ORIGAKER: &str = include_str!("../../../docs/rigs/origaker.toml");

fn played(seed: u64) -> (Story, tempfile::TempDir) {
    let rig = Rig::from_toml(ORIGAKER).expect("the robot's file");
    let folder = tempfile::tempdir().expect("a folder");
    let story = Corridor::new(&rig, folder.path(), seed, || Duration::ZERO).expect("the robot").play(&mut |_| ());
    (story.expect("a story"), folder)
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn the_robot_searches_passes_and_inspects() {
    let (story, folder) = played(1);
    let names: Vec<_> = story.modes.iter().map(|mode| mode["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["gecko", "spider", "stick-bug"]);
    for station in story.modes.iter().flat_map(|mode| mode["stations"].as_array().expect("stations")) {
        let near = number(&station["depth_rel_err_within_1500mm"]["median"]);
        assert!(near < 0.02 && number(&station["points"]) > 100.0, "{station}");
        assert_eq!(station["pose"]["from"], "joints and images", "{station}");
        for side in ["left", "right"] {
            // Gecko and stick-bug have no walls.
            if let Some(error) = station["walls_mm"][side]["error"].as_f64() {
                assert!(error.abs() < 10.0, "{side} wall: {station}");
            }
        }
    }
    assert!(story.modes[1]["stations"][0]["walls_mm"]["left"]["measured"].is_number());
    // One eye finds the target; both measure it.
    assert_eq!(story.found["target_seen_by"], "left");
    assert!(number(&story.found["target_bearing_error_deg"]).abs() < 0.5, "{}", story.found);
    assert!(number(&story.found["target_range_error_mm"]).abs() < 3.0, "{}", story.found);
    for file in
        ["corridor.svg", "gecko-to-spider.svg", "spider-to-stick-bug.svg", "0-gecko.ply", "6-stick-bug-matches.svg"]
    {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}

#[test]
fn a_rig_without_a_trunk_has_no_such_story() {
    let rig = Rig::from_toml(vergence_rig::BENCH_TOML).expect("the bench");
    let refused = Corridor::new(&rig, std::path::Path::new("."), 1, || Duration::ZERO)
        .map(|_| ())
        .map_err(|error| error.to_string());
    assert!(refused.as_ref().is_err_and(|error| error.contains("gecko")), "{refused:?}");
}
