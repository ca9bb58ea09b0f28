//! `vergence sim --elf`, and `--port sim:FIRMWARE`: the firmware answers the other verbs like any board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "common/association.rs"]
mod association;
#[path = "elf_rig/build.rs"]
mod build;
mod common;

use association::Judge;
use common::images::Workshop;
use common::{Simulator, fails_with, run, run_json, small_bench_toml, text};
use serde_json::Value;
use vergence_mcu::{Firmware, LogDecoder};
use vergence_rig::Rig;

#[test]
fn the_firmware_answers_at_a_pseudo_terminal() {
    let elf = build::build("vergence-nucleo-g474");
    let simulator = Simulator::start(&["--elf", elf.to_str().expect("a plain path")]);
    let status = simulator.json(&["status"]);
    println!("{status}");
    assert_eq!(status["board"], "nucleo-g474");
    assert_eq!(status["state"], "idle");
}

/// The eyes on stages that the firmware moves: each pulse of its pin is a pair of images, each pose comes from its encoder counters.
#[test]
fn clouds_are_right_while_the_firmware_moves_the_eyes() {
    let elf = build::build("vergence-nucleo-g474");
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, small_bench_toml()).expect("written");
    let [port, rig, out] =
        [format!("sim:{}", elf.display()), rig.display().to_string(), folder.path().join("out").display().to_string()];
    let tour =
        ["--home", "--mode", "herbivore", "--mode", "human", "--stay", "300ms", "--rate", "10", "--frames", "30"];
    let files = ["--match-time", "100ms", "--out", &out, "--also", "json", "--json"];
    let said = run(&[&["--port", &port, "--rig", &rig, "run", "--cameras", "sim"][..], &tour, &files].concat());
    assert!(said.status.success(), "{}", text(&said.stderr));
    let lines = text(&said.stdout);
    let lines = lines.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON Lines"));
    let clouds: Vec<Value> = lines.filter(|line| line["kind"] == "cloud").collect();
    assert_eq!(clouds.len(), 30);

    let judge = Judge::new(Rig::from_toml(&small_bench_toml()).expect("the bench with small cameras"));
    for is_moving in [true, false] {
        let those = clouds.iter().filter(|line| line["moving"] == is_moving);
        let counts = those.map(|line| judge.wrong_in_line(line));
        let [wrong, swapped, all] = counts.fold([0; 3], |sum, more| [0, 1, 2].map(|at| sum[at] + more[at]));
        println!("moving {is_moving}: {wrong} of {all} matches are wrong, {swapped} with the partner of the next");
        assert!(all > 300 && 100 * wrong < all, "moving {is_moving}: {wrong} of {all} are wrong");
        assert!(10 * swapped > 9 * all, "the check finds matches that are wrong");
    }
    let angle = |line: &Value| line["axes"]["separation_deg"].as_f64().expect("an angle");
    let reached =
        [clouds.iter().map(angle).fold(f64::MAX, f64::min), clouds.iter().map(angle).fold(f64::MIN, f64::max)];
    assert!(reached[1] - reached[0] > 60.0, "the eyes turned: {reached:?}");
}

#[test]
fn the_firmware_is_updated_through_its_boot_loader() {
    let [application, boot_loader] =
        ["vergence-nucleo-g474", "vergence-bootloader"].map(|package| build::build(package).display().to_string());
    let workshop = Workshop::new();
    let image = workshop.path("app.vimg");
    let sign = ["image", "sign", &application, "--key", "development", "--hardware", "nucleo-g474", "--out", &image];
    let made = run_json(&[&sign[..], &["--json"]].concat());
    assert_eq!(made["version"], "0.1.0", "as the application itself says");
    fails_with(&[&sign[..], &["--version", "0.2.0"]].concat(), 2, &["says that it is version 0.1.0, not 0.2.0"]);

    // Another build of the same version.
    let mut other = std::fs::read(&image).expect("an image").split_off(128);
    let note = other.windows(4).position(|window| window == b"GNU\0").expect("a build id");
    other[note + 4] ^= 0xFF;
    let (other, made) = workshop.sign(&other, "development", "nucleo-g474", "0.1.0", "other.vimg");
    let simulator = Simulator::start(&["--elf", &boot_loader, "--elf", &image]);
    let said = simulator.json(&["flash", "--serial", &other]);
    assert_eq!((&said["after"]["boot"], &said["after"]["build"]), (&"confirmed".into(), &made["build"]));
    println!("sent in {} s", said["seconds"]);
    let status = simulator.json(&["status"]);
    assert_eq!((&status["reset"], &status["build"]), (&"Software".into(), &made["build"]));
}

#[test]
fn what_the_pins_did_is_written_at_the_end() {
    let elf = build::build("vergence-nucleo-g474");
    let workshop = Workshop::new();
    let trace = workshop.path("pins.vcd");
    let mut simulator = Simulator::start(&["--elf", elf.to_str().expect("a plain path"), "--trace", &trace]);
    let fired = simulator.run(&["trigger", "--rate", "50", "--count", "3"]);
    assert!(fired.status.success(), "{}", common::text(&fired.stderr));
    simulator.terminate();
    let trace = std::fs::read_to_string(trace).expect("a trace");
    let wires: Vec<&str> = trace.lines().filter(|line| line.starts_with("$var wire 1 ")).collect();
    println!("{}", wires.join("\n"));
    let wire = wires.iter().find(|line| line.contains(" camera_trigger_PB6 ")).expect("the cameras' wire");
    let widths_us = high_for_us(&trace, wire.split(' ').nth(3).expect("its sign"));
    println!("pulses of {widths_us:.3?} us");
    assert!(
        widths_us.len() >= 3 && widths_us.iter().all(|us| (us - 100.0).abs() < 0.1),
        "no other pulse fires the cameras"
    );
    assert!(wires.iter().any(|line| line.contains(" step_1_")));
}

/// How long the wire of this sign was high each time, in microseconds of a trace in picoseconds; where it still is, without end.
fn high_for_us(trace: &str, sign: &str) -> Vec<f64> {
    let (mut at, mut rose, mut widths) = (0.0, None, Vec::new());
    for line in trace.lines() {
        match (line.strip_prefix('#'), line.strip_suffix(sign)) {
            (Some(time), _) => at = time.parse().expect("a time"),
            (_, Some("1")) => rose = rose.or(Some(at)),
            (_, Some("0")) => widths.extend(rose.take().map(|rose: f64| (at - rose) / 1e6)),
            _ => {}
        }
    }
    widths.extend(rose.map(|_| f64::INFINITY));
    widths
}

/// Through all modes and back: the trunk's way out of gecko, a dead centre, is a path of several legs.
#[test]
fn the_firmware_takes_the_robot_through_its_modes() {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rigs/origaker.toml");
    let elf = build::build("vergence-nucleo-g474");
    let simulator = Simulator::start(&["--rig", rig, "--elf", elf.to_str().expect("a plain path")]);
    for mode in ["gecko", "spider", "stick-bug", "spider"] {
        let go = || simulator.run(&["--rig", rig, "mode", mode]);
        let mut output = go();
        // Servos get their settings when the board has started.
        for _ in 0..20 {
            if common::text(&output.stderr).contains("is getting its settings") {
                output = go();
            }
        }
        assert!(output.status.success(), "{mode}: {}", common::text(&output.stderr));
        let status = simulator.json(&["--rig", rig, "status"]);
        println!("{status}");
        assert_eq!((&status["board"], &status["fault"]), (&"nucleo-g474".into(), &serde_json::Value::Null));
        assert_eq!(status["mode"], mode, "{status}");
    }
}

#[test]
fn a_program_for_another_machine_is_refused() {
    let own = std::env::current_exe().expect("this test is a program");
    fails_with(&["sim", "--elf", own.to_str().expect("a plain path")], 2, &["32-bit ELF"]);
}

#[test]
fn the_log_is_decoded_over_the_link() {
    let elf = build::build("vergence-nucleo-g474");
    let elf = elf.to_str().expect("a plain path");
    let simulator = Simulator::start(&["--elf", elf]);
    // The first host hears what the board said before.
    let entry = simulator.json(&["log", "--elf", elf, "--count", "1"]);
    println!("{entry}");
    let build = simulator.json(&["status"])["build"].as_str().expect("a build").to_owned();
    assert_eq!((&entry["level"], &entry["text"]), (&"info".into(), &format!("vergence 0.1.0, build {build}").into()));
    let seconds: f64 = entry["time"].as_str().expect("a time").parse().expect("seconds");
    assert!((0.0..1.0).contains(&seconds), "{seconds}");
}

#[test]
fn the_raw_log_is_what_the_board_sends() {
    let elf = build::build("vergence-nucleo-g474");
    let simulator = Simulator::start(&["--elf", elf.to_str().expect("a plain path")]);
    let output = simulator.run(&["log", "--raw", "--count", "1"]);
    assert!(output.status.success(), "{}", common::text(&output.stderr));
    let firmware = Firmware::from_elf(&std::fs::read(elf).expect("it was built")).expect("it is for this chip");
    let mut decoder = LogDecoder::new(&firmware).expect("it logs by defmt");
    let entries: Vec<_> = decoder.push(&output.stdout).into_iter().flatten().collect();
    assert!(entries.iter().any(|entry| entry.text.starts_with("vergence ")), "{entries:?}");
}

#[test]
fn the_log_of_another_build_is_refused() {
    let elf = build::build("vergence-nucleo-g474");
    let elf = elf.to_str().expect("a plain path");
    fails_with(&["--port", "sim", "log", "--elf", elf], 2, &["this is build", "the board runs build"]);
    let boot_loader = build::build("vergence-bootloader");
    fails_with(&["log", "--elf", boot_loader.to_str().expect("a plain path")], 2, &["no defmt log"]);
}
