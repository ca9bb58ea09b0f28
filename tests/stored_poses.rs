//! What images told of the pose in a mode outlives the program that measured it: `vergence run --poses FILE` of a simulated robot whose
//! cameras are mounted by eye.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod common;

use std::path::Path;

use common::{fails_with, run, text};
use serde_json::Value;
use vergence_rig::{Provenance, Rig, RigCalibration};
use vergence_vision::{Angle, Length};

/// Writes the robot's rig file with small cameras, whose mounts are known to 1 degree and 2 mm.
fn write_rig(file: &Path) {
    let rig = Rig::from_toml(include_str!("../docs/rigs/origaker.toml"))
        .expect("the robot")
        .with_sensors(400)
        .expect("a sensor");
    let calibration = RigCalibration::Sigmas { rotation: Angle::from_deg(1.0), translation: Length::from_mm(2.0) };
    let provenance = Provenance { program: "test".into(), inputs_sha256: String::new(), date: None };
    let text = Rig { calibration, ..rig }.to_toml(&provenance).expect("a rig file");
    std::fs::write(file, text).expect("it is written");
}

/// The lines of two clouds in spider.
fn clouds(rig: &str, poses: &str) -> Vec<Value> {
    let tour = ["--mode", "spider", "--rate", "2", "--match-time", "100ms", "--frames", "2", "--poses", poses];
    let output = run(&[&["--port", "sim", "--rig", rig, "--json", "run", "--cameras", "sim"], &tour[..]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let lines = text(&output.stdout);
    let lines = lines.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON Lines"));
    lines.filter(|line| line["kind"] == "cloud" && line["moving"] == false).collect()
}

fn told(line: &Value, by: &str) -> f64 {
    line["pose_source"][by].as_f64().unwrap_or_else(|| panic!("{}", line["pose_source"]))
}

#[test]
fn a_later_run_begins_with_what_an_earlier_one_found_and_only_on_its_own_rig() {
    let folder = tempfile::tempdir().expect("a folder");
    let [rig, poses] = ["rig.toml", "poses.toml"].map(|name| folder.path().join(name));
    write_rig(&rig);
    let names = [&rig, &poses].map(|path| path.to_str().expect("a name").to_owned());
    let first = clouds(&names[0], &names[1]);
    let kept = std::fs::read_to_string(&poses).expect("something was kept");
    assert!(kept.contains("[modes.spider]") && kept.contains("visits = 1"), "{kept}");
    assert_eq!(first.last().expect("a cloud")["pose_source"]["from"], "joints and images");
    let second = clouds(&names[0], &names[1]);
    let line = second.last().expect("a cloud");
    assert_eq!(line["pose_source"]["from"], "joints, stored pose and images");
    let all: f64 = ["told_by_joints", "told_by_stored", "told_by_images"].iter().map(|by| told(line, by)).sum();
    assert!(told(line, "told_by_stored") > 0.1 && (all - 6.0).abs() < 0.01, "{}", line["pose_source"]);
    assert!(std::fs::read_to_string(&poses).expect("it is there").contains("visits = 2"));
    // The same file beside a rig that was changed, and files that are none.
    let changed = std::fs::read_to_string(&rig).expect("a rig").replace("2 mm", "3 mm").replace("2mm", "3mm");
    let other = folder.path().join("other.toml");
    std::fs::write(&other, changed).expect("written");
    let other = other.to_str().expect("a name");
    let with = |rig: &str, poses: &str, words: &[&str]| {
        fails_with(&["--port", "sim", "--rig", rig, "run", "--cameras", "sim", "--poses", poses], 2, words);
    };
    with(other, &names[1], &["poses.toml", "belongs to another rig file"]);
    let later = folder.path().join("later.toml");
    std::fs::write(&later, kept.replace("format = 1", "format = 9")).expect("written");
    with(&names[0], later.to_str().expect("a name"), &["later.toml", "format 9"]);
    with(&names[0], &names[0], &["rig.toml", "no file of stored poses"]);
}
