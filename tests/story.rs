//! Stories in two terminals: a simulated board in one process, verbs in others, and what can go wrong between them.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use common::{Simulator, fails_with, text, vergence};
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{MAX_FRAME, PROTOCOL, ProtocolVersion, Receiver, Report, Request, schema_hash};

#[allow(clippy::disallowed_methods, reason = "the stories run against a simulator in real time")]
fn wait(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
}

fn near(value: &serde_json::Value, target: f64) {
    let value = value.as_f64().expect("a number");
    assert!((value - target).abs() < 0.03, "{value} is not {target}");
}

#[test]
fn verbs_follow_each_other_over_a_pty() {
    let simulator = Simulator::start(&["--pty"]);
    let before = simulator.json(&["status"]);
    assert_eq!(before["state"], "idle");
    assert_eq!(before["referenced"], serde_json::json!([false, false]));

    let refused = simulator.run(&["mode", "herbivore"]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(text(&refused.stderr).contains("vergence home"));

    simulator.json(&["home"]);
    // Homing leaves the baseline at the end of its range, or a hair beyond by the encoder: that is no reason to refuse.
    near(&simulator.json(&["move", "--separation", "20deg"])["achieved"]["separation_deg"], 20.0);
    near(&simulator.json(&["move", "--by", "--separation", "5deg"])["axes"]["separation_deg"], 25.0);
    near(&simulator.json(&["plan", "--separation", "30deg"])["to"]["baseline_mm"], 60.0);
    let herbivore = simulator.json(&["mode", "herbivore"]);
    near(&herbivore["achieved"]["baseline_mm"], 145.0);
    near(&herbivore["achieved"]["separation_deg"], 120.0);

    // One axis named: the other stays.
    let moved = simulator.json(&["move", "--baseline", "120mm"]);
    near(&moved["achieved"]["baseline_mm"], 120.0);
    near(&moved["achieved"]["separation_deg"], 120.0);

    // Disarmed, referenced and where it was: the next verb starts from there.
    let after = simulator.json(&["status"]);
    assert_eq!((after["state"].as_str(), after["fault"].is_null()), (Some("idle"), true));
    assert_eq!(after["referenced"], serde_json::json!([true, true]));
    let lines = simulator.run(&["monitor", "--count", "5"]);
    assert_eq!(text(&lines.stdout).lines().count(), 5);
    let clock = &after["clock"];
    assert_eq!(clock["lost"], false);
    assert!(clock["sigma_us"].as_f64().is_some_and(|sigma| sigma > 0.0), "{clock}");
    assert!(simulator.run(&["arm", "--for", "200ms"]).status.success());
    assert!(simulator.run(&["disarm"]).status.success());
}

#[test]
fn a_host_killed_in_mid_move_is_a_lost_link_and_never_resumes() {
    let simulator = Simulator::start(&["--tcp", "127.0.0.1:0"]);
    simulator.json(&["home"]);
    let mut host = simulator.command(&["mode", "herbivore"]).spawn().expect("the binary runs");
    wait(0.8);
    host.kill().expect("killed");
    host.wait().expect("gone");
    // The lease of a second, then v/a + a/j: 0.25 s + 0.06 s for the separation.
    wait(1.6);
    let lost = simulator.json(&["status"]);
    assert_eq!((lost["state"].as_str(), lost["fault"]["code"].as_str()), (Some("link lost"), Some("LeaseExpired")));
    let silence = lost["fault"]["detail"].as_f64().expect("microseconds");
    assert!((1e6..1.05e6).contains(&silence), "it braked {silence} us after the last heartbeat");
    let separation = |status: &serde_json::Value| status["axes"]["separation_deg"].as_f64().expect("an angle");
    let there = separation(&lost);
    assert!(there > 1.0 && there < 119.0, "it was not in mid-move: {there}");
    wait(0.3);
    assert!((separation(&simulator.json(&["status"])) - there).abs() < 0.01, "it still moves");

    let refused = simulator.run(&["home"]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(text(&refused.stderr).contains("vergence clear"));
    let cleared = simulator.json(&["clear"]);
    assert_eq!(cleared["state"], "idle");
    assert!((separation(&cleared) - there).abs() < 0.01, "clearing moved it");
    simulator.json(&["home"]);
    simulator.json(&["mode", "human"]);
}

#[test]
fn saved_settings_outlive_the_board_and_others_do_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (flash, backup) = (file("flash"), file("settings.toml"));
    let switched_on = || Simulator::start(&["--pty", "--flash", &flash]);
    let get = |simulator: &Simulator, key: &str| simulator.json(&["config", "get", key])[key].clone();

    let mut simulator = switched_on();
    simulator.json(&["config", "get", "--out", &backup]);
    assert_eq!(get(&simulator, "baseline.speed"), "80mm/s");
    assert_eq!(simulator.json(&["config", "set", "baseline.speed", "40mm/s"])["before"], "80mm/s");
    simulator.json(&["config", "save"]);
    simulator.json(&["config", "set", "baseline.speed", "20mm/s"]);
    let bad = simulator.run(&["config", "set", "baseline.min", "230mm"]);
    assert_eq!(bad.status.code(), Some(2));
    assert!(text(&bad.stderr).contains("baseline.min cannot be 230mm"), "{}", text(&bad.stderr));
    assert_eq!(get(&simulator, "baseline.speed"), "20mm/s");

    simulator.kill();
    let mut simulator = switched_on();
    assert_eq!(get(&simulator, "baseline.speed"), "40mm/s");
    // The planner of the board, and with it the plan of the host, obeys.
    let plan = simulator.json(&["plan", "--baseline", "220mm"]);
    assert!(plan["duration_s"].as_f64().is_some_and(|seconds| seconds > 4.0), "{plan}");

    // A range that moves past itself fits only in one order; the file finds it, and is taken whole or not at all.
    let moved = file("moved.toml");
    std::fs::write(&moved, "[separation]\nmin = \"140deg\"\nmax = \"150deg\"\nhome_switch_at = \"138deg\"\n")
        .expect("written");
    assert_eq!(simulator.json(&["config", "set", "--file", &moved])["changed"].as_array().map(Vec::len), Some(3));
    simulator.json(&["config", "set", "--file", &backup]);
    std::fs::write(&moved, "[baseline]\nspeed = \"30mm/s\"\nmin = \"230mm\"\n").expect("written");
    let refused = simulator.run(&["config", "set", "--file", &moved]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("baseline.min = 230mm"), "{}", text(&refused.stderr));
    assert_eq!(get(&simulator, "baseline.speed"), "80mm/s");
    simulator.json(&["config", "restore"]);
    simulator.json(&["config", "save"]);
    simulator.kill();
    assert_eq!(get(&switched_on(), "baseline.speed"), "80mm/s");
}

#[test]
fn the_recorder_tells_what_led_to_a_fault() {
    let simulator = Simulator::start(&["--pty"]);
    simulator.json(&["home"]);
    let mut host = simulator.command(&["mode", "herbivore"]).spawn().expect("the binary runs");
    wait(0.8);
    host.kill().expect("killed");
    host.wait().expect("gone");
    wait(1.6);
    let why = simulator.json(&["status", "--why"])["why"].clone();
    assert_eq!(why["times_from"], "the fault");
    let events = why["events"].as_array().expect("a list");
    let position = |part: &str| {
        let found = events.iter().position(|event| event["text"].as_str().is_some_and(|text| text.contains(part)));
        found.unwrap_or_else(|| panic!("'{part}' is not in {why}"))
    };
    let fault = position("the host fell silent");
    assert_eq!(events[fault]["fault"], "LeaseExpired");
    assert_eq!(events[fault]["from_fault_us"], 0);
    assert!(position("state: moving") < fault && fault < position("by its encoder"), "{why}");
    let times: Vec<_> = events.iter().map(|event| event["from_fault_us"].as_i64().expect("a time")).collect();
    assert!(times.is_sorted(), "{times:?}");
    let told = text(&simulator.run(&["status", "--why"]).stdout);
    assert!(told.contains("FAULT: the host fell silent"), "{told}");
    let doctor = simulator.run(&["doctor"]);
    assert_eq!(doctor.status.code(), Some(1));
    let told = text(&doctor.stdout);
    assert!(told.contains("fail  state") && told.contains("vergence clear"), "{told}");
}

#[test]
fn a_jog_needs_no_reference_and_the_trigger_no_arming() {
    let simulator = Simulator::start(&["--pty"]);
    let jogged = simulator.json(&["move", "--by", "--baseline", "5mm", "--separation", "-2deg"]);
    assert_eq!(jogged["referenced"], serde_json::json!([false, false]));
    near(&jogged["moved_by"]["baseline_mm"], 5.0);
    near(&jogged["moved_by"]["separation_deg"], -2.0);
    // Without a reference, arming puts the zero where the axis stands.
    let back = simulator.json(&["move", "--by", "--baseline", "-5mm"]);
    near(&back["moved_by"]["baseline_mm"], -5.0);
    near(&back["moved_by"]["separation_deg"], 0.0);
    let lines = simulator.run(&["trigger", "--rate", "50", "--count", "10", "--json"]);
    let marks: Vec<serde_json::Value> =
        text(&lines.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let times: Vec<_> = marks.iter().map(|mark| mark["board_us"].as_u64().expect("a time")).collect();
    assert_eq!(times.len(), 10);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 20_000), "{times:?}");
    assert_eq!(marks[9]["seq"], 9);
}

#[test]
fn stop_works_while_another_vergence_holds_the_port() {
    let simulator = Simulator::start(&["--pty"]);
    simulator.json(&["home"]);
    let mover = simulator.command(&["mode", "herbivore"]).stderr(std::process::Stdio::piped()).spawn().expect("runs");
    wait(0.8);
    let second = simulator.run(&["disarm"]);
    assert_eq!(second.status.code(), Some(3));
    assert!(text(&second.stderr).contains("in use"));
    // The one that drives passes on what the board reports.
    assert_eq!(simulator.json(&["status"])["state"], "moving");
    // Not even a rig file that is none keeps it from stopping.
    assert!(simulator.run(&["--rig", "/nowhere/rig.toml", "stop"]).status.success());
    let moved = mover.wait_with_output().expect("it ends");
    assert_eq!(moved.status.code(), Some(3), "{}", text(&moved.stderr));
    assert!(text(&moved.stderr).contains("stopped by another"), "{}", text(&moved.stderr));
    let status = simulator.json(&["status"]);
    assert_eq!((status["state"].as_str(), status["fault"].is_null()), (Some("idle"), true));
    // Nobody holds the port now.
    assert_eq!(simulator.json(&["--rig", "/nowhere/rig.toml", "stop"])["state"], "idle");
}

#[test]
fn a_board_that_vanishes_is_told_clearly() {
    for kind in [&["--pty"][..], &["--tcp", "127.0.0.1:0"]] {
        let mut simulator = Simulator::start(kind);
        let mut watcher = simulator.command(&["monitor", "--no-reconnect"]);
        let watcher = watcher.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
        let watcher = watcher.spawn().expect("the binary runs");
        wait(0.5);
        simulator.kill();
        let ended = watcher.wait_with_output().expect("it ends");
        assert_eq!(ended.status.code(), Some(3));
        assert!(text(&ended.stderr).contains("the link closed"), "{}", text(&ended.stderr));
        let port = simulator.port.clone();
        fails_with(&["--port", &port, "status"], 3, &[&port]);
    }
}

/// A simulator at the port of one that has just been killed, as a board that was plugged in again.
fn restarted(killed: &Simulator) -> Simulator {
    let address = killed.port.strip_prefix("tcp:").expect("a TCP port");
    Simulator::start(&["--tcp", address])
}

#[test]
fn a_monitor_outlives_its_board() {
    // A name that follows the device, as a udev rule gives it.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let name = folder.path().join("board");
    let plugged_in = || {
        let simulator = Simulator::start(&["--pty"]);
        // There is none yet the first time.
        let _ = std::fs::remove_file(&name);
        std::os::unix::fs::symlink(&simulator.port, &name).expect("a link");
        simulator
    };
    let mut simulator = plugged_in();
    let mut watcher = vergence(&["--port", name.to_str().expect("a name"), "monitor", "--json", "--for", "8s"]);
    let watcher = watcher.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    let watcher = watcher.spawn().expect("the binary runs");
    wait(0.5);
    simulator.kill();
    wait(0.5);
    let _again = plugged_in();
    let ended = watcher.wait_with_output().expect("it ends");
    let said = text(&ended.stderr);
    assert!(ended.status.success(), "{said}");
    assert!(said.contains("the link closed") && said.contains("trying") && said.contains("connected again"), "{said}");
    let times: Vec<u64> = text(&ended.stdout)
        .lines()
        .map(|line| {
            serde_json::from_str::<serde_json::Value>(line).expect("JSON")["board_us"].as_u64().expect("a time")
        })
        .collect();
    let restarts = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
    assert_eq!(restarts, 1, "poses of the first board, then poses of the second");
}

#[test]
fn a_board_that_comes_back_is_not_armed_again() {
    let mut simulator = Simulator::start(&["--tcp", "127.0.0.1:0"]);
    let mut holder = simulator.command(&["arm"]);
    let holder = holder.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    let holder = holder.spawn().expect("the binary runs");
    wait(0.5);
    simulator.kill();
    let again = restarted(&simulator);
    let ended = holder.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(3));
    assert!(text(&ended.stdout).starts_with("armed"), "{}", text(&ended.stdout));
    assert!(text(&ended.stderr).contains("nothing was armed again"), "{}", text(&ended.stderr));
    assert_eq!(again.json(&["status"])["state"], "idle");
}

/// Something on a TCP port that is no board; serves one host.
fn impostor(behave: impl FnOnce(TcpStream) + Send + 'static) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = format!("tcp:{}", listener.local_addr().expect("an address"));
    (port, spawn(move || behave(listener.accept().expect("a host").0)))
}

#[test]
fn random_bytes_on_the_port_are_noise() {
    let (port, server) = impostor(|mut stream| {
        let mut state = 1u64;
        loop {
            let noise: Vec<u8> = std::iter::repeat_with(|| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 56) as u8
            })
            .take(4096)
            .collect();
            if stream.write_all(&noise).is_err() {
                return;
            }
            wait(0.01);
        }
    });
    fails_with(&["--port", &port, "status"], 3, &[&port, "no valid message"]);
    server.join().expect("the host closed the link");
}

#[test]
fn silence_on_the_port_is_told() {
    let (port, server) = impostor(|mut stream| {
        let mut sink = Vec::new();
        let _ = stream.read_to_end(&mut sink);
    });
    fails_with(&["--port", &port, "status"], 3, &[&port, "no answer"]);
    server.join().expect("the host closed the link");
}

#[test]
fn a_board_of_another_protocol_version_is_refused_with_4() {
    let (port, server) = impostor(|mut stream| {
        let mut receiver = Receiver::new();
        let mut bytes = [0; 256];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            for &byte in &bytes[..length] {
                let Some(frame) = receiver.push(byte) else { continue };
                let Ok(Request::Hello { session, .. }) = frame.body::<Request>() else { continue };
                let protocol = ProtocolVersion { major: 9, minor: 1 };
                let hello = Report::Hello { protocol, schema: schema_hash() ^ 1, session, boot: 7 };
                let header = Header { major: 9, kind: Kind::Immediate, seq: 0, ack: 0 };
                let mut buffer = [0; MAX_FRAME];
                let length = encode(header, &hello, &mut buffer).expect("it fits");
                if stream.write_all(&buffer[..length]).is_err() {
                    return;
                }
            }
        }
    });
    let ours = format!("{}.{}", PROTOCOL.major, PROTOCOL.minor);
    fails_with(&["--port", &port, "home"], 4, &["9.1", &ours, "update"]);
    server.join().expect("the host closed the link");
}
