//! The firmware with another number of axes, on a chip that is wired so, with the rig file for it.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

#[path = "elf_rig/build.rs"]
mod build;
mod common;

use std::sync::{Mutex, MutexGuard, PoisonError};

use common::{Simulator, text};

fn rig_file(name: &str) -> String {
    format!("{}/../../docs/rigs/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// One simulated chip at a time: they run in real time, and the machine may be busy.
static TURN: Mutex<()> = Mutex::new(());

/// Starts a board whose firmware was built with `feature`, wired for the rig of the file. The next one waits for the first value.
fn simulator(feature: &str, rig: &str) -> (MutexGuard<'static, ()>, Simulator) {
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let elf = build::build_wired(feature).display().to_string();
    (turn, Simulator::start(&["--rig", rig, "--elf", &elf]))
}

/// Homes the rig and goes to these modes, where the board must report these positions, in millimetres and degrees.
fn goes_to(simulator: &Simulator, rig: &str, modes: &[(&str, &[(&str, f64)])]) {
    let home = simulator.run(&["--rig", rig, "home"]);
    assert!(home.status.success(), "{}", text(&home.stderr));
    for (mode, positions) in modes {
        let output = simulator.run(&["--rig", rig, "mode", mode]);
        assert!(output.status.success(), "{mode}: {}", text(&output.stderr));
        let status = simulator.json(&["--rig", rig, "status"]);
        println!("{status}");
        assert_eq!((&status["fault"], &status["mode"]), (&serde_json::Value::Null, &(*mode).into()));
        for (axis, expected) in *positions {
            let position = status["axes"][axis].as_f64().expect("a position");
            assert!((position - expected).abs() < 0.025, "{axis} should be at {expected}");
        }
    }
}

#[test]
fn one_linear_stage() {
    let rig = rig_file("one-axis");
    let modes: [(&str, &[_]); 2] = [("near", &[("baseline_mm", 70.0)]), ("far", &[("baseline_mm", 210.0)])];
    let (_turn, simulator) = simulator("one-axis", &rig);
    goes_to(&simulator, &rig, &modes);
}

const ASIDE: (&str, &[(&str, f64)]) = ("aside", &[("baseline_mm", 100.0), ("left_deg", 10.0), ("right_deg", 110.0)]);
const AHEAD: (&str, &[(&str, f64)]) = ("ahead", &[("baseline_mm", 145.0), ("left_deg", 0.0), ("right_deg", 0.0)]);

#[test]
fn a_linear_stage_and_a_pinion_for_each_camera() {
    let rig = rig_file("three-axes");
    let (_turn, simulator) = simulator("three-axes", &rig);
    goes_to(&simulator, &rig, &[ASIDE, AHEAD]);
}

/// The third encoder has a counter of 16 bits, which 110 degrees of this encoder turn over four times.
#[test]
fn a_counter_of_16_bits_is_extended() {
    let file = std::fs::read_to_string(rig_file("three-axes")).expect("a rig file");
    let (before, last) = file.rsplit_once("counts_per_revolution = 100000").expect("the last axis");
    let workshop = common::images::Workshop::new();
    let rig = workshop.file("rig.toml", format!("{before}counts_per_revolution = 1000000{last}").as_bytes());
    let (_turn, simulator) = simulator("three-axes", &rig);
    let set = simulator.run(&["--rig", &rig, "config", "set", "right.counts_per_revolution", "1000000"]);
    assert!(set.status.success(), "{}", text(&set.stderr));
    goes_to(&simulator, &rig, &[ASIDE, AHEAD, ASIDE]);
}

#[test]
fn a_rig_with_other_axes_than_the_firmware_is_refused() {
    let rig = rig_file("one-axis");
    let (_turn, simulator) = simulator("one-axis", &rig);
    let output = simulator.run(&["home"]);
    let said = text(&output.stderr);
    println!("{said}");
    assert!(!output.status.success() && said.contains("axes"), "{said}");
}
