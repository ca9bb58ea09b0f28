//! Stories of verbs that drive a board: interrupted, faulted, logged, reloaded.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::io::{BufRead, BufReader};
use std::process::{Child, Output, Stdio};

use common::{Simulator, signal, text};
use serde_json::Value;

fn fails(output: &Output, code: i32, words: &[&str]) -> String {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "should mention '{word}': {said}"));
    said
}

/// Starts `arm` and waits until it says that the board is armed.
fn armed(simulator: &Simulator) -> Child {
    let mut child =
        simulator.command(&["arm"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut line = String::new();
    let said = child.stdout.as_mut().expect("piped");
    BufReader::with_capacity(1, said).read_line(&mut line).expect("it says so");
    assert!(line.starts_with("armed"), "{line}");
    child
}

#[test]
fn an_interruption_of_arm_disarms_and_is_success() {
    let simulator = Simulator::start(&["--pty"]);
    for name in ["-INT", "-TERM"] {
        let child = armed(&simulator);
        signal(child.id(), name);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains("idle"), "{}", text(&output.stdout));
        assert_eq!(simulator.json(&["status"])["state"], "idle");
    }
}

#[test]
fn an_interrupted_move_brakes_and_disarms() {
    let simulator = Simulator::start(&["--pty"]);
    simulator.json(&["home"]);
    let child = simulator.command(&["mode", "herbivore"]).stderr(Stdio::piped()).spawn().expect("it starts");
    while simulator_is_idle(&child) {
        std::hint::spin_loop();
    }
    signal(child.id(), "-INT");
    let output = child.wait_with_output().expect("it ends");
    fails(&output, 3, &["braked", "disarmed"]);
    let status = simulator.json(&["status"]);
    assert_eq!((&status["state"], &status["fault"]), (&"idle".into(), &Value::Null));
}

/// Until the process has installed its signal handlers: it catches SIGINT (bit 1 of SigCgt) once it waits for it.
fn simulator_is_idle(child: &Child) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or_default();
    u64::from_str_radix(caught.trim(), 16).is_ok_and(|caught| caught & 2 == 0)
}

/// The host dies while the board is armed: a fault is latched, and every advice leads out of it.
#[test]
fn advice_leads_out_of_a_fault() {
    let simulator = Simulator::start(&["--pty"]);
    let mut child = armed(&simulator);
    child.kill().expect("killed");
    child.wait().expect("gone");
    while simulator.json(&["status"])["fault"].is_null() {}
    let said = fails(&simulator.run(&["config", "factory"]), 3, &["vergence clear"]);
    assert!(!said.contains("disarm"), "{said}");
    fails(&simulator.run(&["disarm"]), 3, &["vergence clear"]);
    fails(&simulator.run(&["config", "reload"]), 3, &["vergence clear"]);
    simulator.json(&["clear"]);
    simulator.json(&["config", "factory"]);
    simulator.json(&["config", "restore"]);
}

#[test]
fn settings_go_back_to_the_saved_ones_or_to_the_factory_s() {
    let simulator = Simulator::start(&["--pty"]);
    let speed = || simulator.json(&["config", "get", "baseline.speed"])["baseline.speed"].clone();
    let factory = speed();
    simulator.json(&["config", "set", "baseline.speed", "30mm/s"]);
    simulator.json(&["config", "save"]);
    simulator.json(&["config", "set", "baseline.speed", "20mm/s"]);
    simulator.json(&["config", "reload"]);
    assert_eq!(speed(), "30mm/s");
    simulator.json(&["config", "factory"]);
    assert_eq!(speed(), factory);
    simulator.json(&["config", "reload"]);
    assert_eq!(speed(), "30mm/s");
}

/// Regression: the log of a simulated board was always empty, and so was that of a real one after any other verb.
/// The simulated stages have plain drivers, so that a driver with a serial line is one that does not answer.
#[test]
fn a_motor_driver_that_cannot_be_used_is_told_by_every_verb() {
    let simulator = Simulator::start(&["--pty"]);
    let healthy = text(&simulator.run(&["status"]).stdout);
    assert!(!healthy.contains("driver"), "{healthy}");
    fails(&simulator.run(&["config", "set", "separation.run_current", "3000mA"]), 2, &["245mA", "1767mA"]);
    let set = simulator.run(&["config", "set", "separation.driver", "tmc2209"]);
    assert!(text(&set.stdout).contains("separation.driver is tmc2209, it was plain"), "{}", text(&set.stderr));
    let told = |status: &str| status.contains("motor driver of separation: ");
    let mut status = text(&simulator.run(&["status"]).stdout);
    while told(&status) && status.contains("getting its settings") {
        status = text(&simulator.run(&["status"]).stdout);
    }
    assert!(told(&status) && status.contains("not usable: the motor driver does not answer"), "{status}");
    let doctor = text(&simulator.run(&["doctor"]).stdout);
    assert!(doctor.contains("cannot be used") && doctor.contains("serial wire"), "{doctor}");
    fails(&simulator.run(&["home"]), 3, &["does not answer", "separation", "vergence doctor"]);
    assert!(simulator.run(&["config", "set", "separation.driver", "plain"]).status.success());
    assert!(simulator.run(&["home"]).status.success());
}

/// The simulated stages have their switches at the low end, normally open, and limits that are normally closed.
#[test]
fn ends_and_contacts_of_switches_are_settings_with_words() {
    let simulator = Simulator::start(&["--pty"]);
    let set = |key: &str, value: &str| simulator.run(&["config", "set", key, value]);
    assert!(text(&set("baseline.home_end", "high").stdout).contains("baseline.home_end is high, it was low"));
    fails(&simulator.run(&["home"]), 3, &["home_switch_at", "home_end", "baseline"]);
    let doctor = text(&simulator.run(&["doctor"]).stdout);
    assert!(doctor.contains("other end of its range") && doctor.contains("baseline.home_end"), "{doctor}");
    // Both at once, from a file; the switch that is said to be there is not.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("high.toml");
    std::fs::write(&file, "[baseline]\nhome_switch_at = \"222mm\"\nhome_end = \"high\"\n").expect("the folder is ours");
    let file = file.to_str().expect("a name");
    assert!(simulator.run(&["config", "set", "--file", file]).status.success());
    assert!(simulator.run(&["config", "factory"]).status.success());
    for (key, value, words) in [
        ("baseline.home_switch", "stallguard", ["normally_open", "tmc2209"]),
        ("baseline.home_switch", "optical", ["normally_closed", "stallguard"]),
        ("baseline.stall_watch", "true", ["false", "stallguard"]),
        ("baseline.home_switch_at", "100mm", ["baseline.min", "baseline.max"]),
    ] {
        fails(&set(key, value), 2, &words);
    }
    let warns = |verb: &str| {
        let output = simulator.run(&[verb]);
        text(&output.stdout).contains("normally open") || text(&output.stderr).contains("normally open")
    };
    assert!(!warns("status") && !warns("doctor"));
    assert!(set("separation.hard_limit", "normally_open").status.success());
    assert!(warns("status") && warns("doctor"));
}

#[test]
fn the_log_tells_what_happened_and_what_happens() {
    let simulator = Simulator::start(&["--pty"]);
    simulator.json(&["home"]);
    let output = simulator.run(&["log", "--for", "1s"]);
    let said = text(&output.stdout);
    println!("{said}");
    assert!(output.status.success(), "{}", text(&output.stderr));
    for word in ["the board started", "homing", "home switch closed"] {
        assert!(said.contains(word), "should tell of '{word}': {said}");
    }
    let entries = simulator.run(&["log", "--count", "2", "--json"]);
    let entries: Vec<Value> =
        text(&entries.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(entries.len(), 2);
    assert_eq!(entries[0]["text"], "the board started");
}

#[test]
fn a_port_in_use_is_not_taken_for_a_board_without_power() {
    let simulator = Simulator::start(&["--tcp", "127.0.0.1:0"]);
    let mut child = armed(&simulator);
    for verb in [&["status"][..], &["flash", "--restart"]] {
        let said = fails(&simulator.run(verb), 3, &["in use by another vergence"]);
        assert!(!said.contains("powered"), "{said}");
    }
    signal(child.id(), "-INT");
    child.wait().expect("it ends");
}

#[test]
fn sessions_do_not_flood_the_story_of_a_fault() {
    let simulator = Simulator::start(&["--pty"]);
    for _ in 0..5 {
        simulator.json(&["status"]);
    }
    let said = text(&simulator.run(&["status", "--why"]).stdout);
    let sessions = said.lines().filter(|line| line.contains("session")).count();
    assert_eq!(sessions, 1, "{said}");
    assert!(said.contains("before it"), "{said}");
}

/// Starts `monitor --json`; returns it with the lines that it prints.
fn monitored(simulator: &Simulator, more: &[&str]) -> (Child, impl Iterator<Item = Value>) {
    let mut command = simulator.command(&["monitor", "--json"]);
    let mut child = command.args(more).stdout(Stdio::piped()).spawn().expect("it starts");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    (child, lines.map(|line| serde_json::from_str(&line.expect("a line")).expect("JSON")))
}

#[test]
fn a_move_is_watched_by_a_monitor_that_was_there_before() {
    let simulator = Simulator::start(&["--pty"]);
    let (mut monitor, mut lines) = monitored(&simulator, &[]);
    assert_eq!(lines.next().expect("a pose")["state"], "idle");
    simulator.json(&["home"]);
    assert!(lines.any(|line| line["state"] == "homing"), "the monitor sees the homing");
    assert!(lines.any(|line| line["state"] == "idle"), "and that it is over");
    // With the port to itself again, it compares the clocks.
    assert!(lines.any(|line| !line["clock"]["error_us"].is_null()), "it reads the board itself again");
    signal(monitor.id(), "-INT");
    // A full pipe would hold the monitor up.
    lines.for_each(drop);
    assert!(monitor.wait().expect("it ends").success());
}

#[test]
fn several_read_a_board_that_one_drives() {
    let simulator = Simulator::start(&["--pty"]);
    let driver = armed(&simulator);
    let watchers: Vec<_> = (0..2).map(|_| monitored(&simulator, &["--count", "5"])).collect();
    for (mut monitor, lines) in watchers {
        assert!(lines.inspect(|line| assert_eq!(line["state"], "ready")).count() == 5);
        assert!(monitor.wait().expect("it ends").success());
    }
    assert_eq!(simulator.json(&["status"])["state"], "ready");
    fails(&simulator.run(&["home"]), 3, &["in use by another vergence"]);
    signal(driver.id(), "-INT");
    assert!(driver.wait_with_output().expect("it ends").status.success());
}
