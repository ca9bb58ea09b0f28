//! The command line: results, exit codes, and what bad input is told.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::{fails_with, run, run_json, text};
use serde_json::Value;

const VERBS: &[&str] = &[
    "devices",
    "rig",
    "status",
    "doctor",
    "arm",
    "disarm",
    "clear",
    "home",
    "mode",
    "move",
    "plan",
    "stop",
    "monitor",
    "trigger",
    "link-test",
    "log",
    "config",
    "flash",
    "image",
    "sim",
    "demo",
    "reproduce",
    "record",
    "replay",
    "export",
    "run",
    "servo",
    "depth",
    "models",
    "zones",
    "capture",
    "calibrate",
    "camera",
    "target",
    "bench",
    "soak",
    "completions",
    "panel",
    "peers",
];

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

#[test]
fn every_verb_has_help() {
    let overview = text(&run(&["--help"]).stdout);
    for verb in VERBS {
        assert!(overview.contains(verb), "--help does not list {verb}");
        let output = run(&[verb, "--help"]);
        assert!(output.status.success());
        let help = text(&output.stdout);
        assert!(help.contains("--json") && help.contains("Usage"), "{verb} --help: {help}");
    }
}

#[test]
fn the_page_of_commands_names_every_verb_and_no_other() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    let page = std::fs::read_to_string(page).expect("docs/commands.md");
    let named = |line: &str| {
        let rest = line.strip_prefix("### vergence ").or_else(|| line.strip_prefix("| `vergence "))?;
        Some(rest.split(['`', ' ']).next().unwrap_or_default().to_owned())
    };
    let mut named: Vec<String> = page.lines().filter_map(named).collect();
    named.sort();
    named.dedup();
    let mut verbs = VERBS.to_vec();
    verbs.sort_unstable();
    assert_eq!(named, verbs);
}

#[test]
fn zones_of_the_herbivore_bench() {
    let folder = temporary();
    let svg = path(&folder, "zones.svg");
    let pose = ["--baseline", "145mm", "--separation", "120deg", "--fov", "195.95deg", "--radius", "350mm"];
    let zones = run_json(&[&["zones", "--json", "--svg", &svg], &pose[..]].concat());
    let expected = [
        ("exact", [("stereo", 57.15), ("mono", 236.65), ("blind", 66.19)]),
        ("paper_eq3", [("stereo", 55.80), ("mono", 209.46), ("blind", 94.75)]),
    ];
    for (formula, angles) in expected {
        for (zone, degrees) in angles {
            let got = zones[formula][zone].as_f64().expect("a number");
            assert!((got - degrees).abs() < 0.006, "{formula} {zone}: {got}");
        }
    }
    let drawing = std::fs::read_to_string(svg).expect("an SVG");
    assert!(drawing.starts_with("<svg") && drawing.trim_end().ends_with("</svg>"));
}

#[test]
fn an_in_process_board_homes_and_moves_without_waiting() {
    let home = run_json(&["--port", "sim", "home", "--json"]);
    assert_eq!(home["referenced"], serde_json::json!([true, true]));
    fails_with(&["--port", "sim", "mode", "human"], 3, &["no reference", "vergence home", "axis 0 is baseline"]);
}

#[test]
fn a_plan_is_a_text_that_can_be_compared() {
    let dump = || text(&run(&["plan", "herbivore", "--dump"]).stdout);
    let plan = dump();
    assert_eq!(plan, dump());
    for line in [
        "baseline    60.000 mm -> 145.000 mm, at most 45.455 mm/s",
        "takes 2.310 s within the limits of native-sim",
        "     0.00000      60.0000       0.0000        0.000       1467.5",
        "     2.30998     145.0000       0.0000        0.000          0.0",
        "     0.31000       9.3000      59.9999        0.000          0.0",
    ] {
        assert!(plan.lines().any(|it| it.ends_with(line)), "'{line}' is not in\n{plan}");
    }
    // An axis that stays has no segments, and the zones are those of the goal.
    let turn = run_json(&["plan", "herbivore", "--from", "human", "--json"]);
    assert_eq!(turn["axes"][0]["segments"], serde_json::json!([]));
    assert_eq!(turn["zones_deg"]["stereo"].as_f64().map(f64::round), Some(57.0));
    fails_with(&["plan"], 2, &["MODE"]);
    fails_with(&["plan", "--baseline", "500mm"], 2, &["500", "220"]);
    fails_with(&["plan", "human", "--from", "gecko"], 2, &["gecko", "herbivore"]);
}

#[test]
fn a_thousand_poses_each_second_for_ten_minutes_and_none_is_lost() {
    let link = run_json(&["--port", "sim", "link-test", "--seconds", "600", "--stream", "1ms", "--json"]);
    assert!(link["poses"].as_u64().is_some_and(|poses| poses >= 599_990), "{link}");
    for none in ["poses_lost", "unanswered", "retransmitted"] {
        assert_eq!(link[none], 0, "{none} in {link}");
    }
    assert_eq!(link["clock"]["lost"], false);
    let drift = link["clock"]["drift_ppm"].as_f64().expect("a drift");
    assert!((drift - 40.0).abs() < 1.0, "the simulated board runs 40 ppm fast, not {drift}");
}

#[test]
fn the_doctor_says_what_is_wrong_and_what_to_do() {
    // Of this machine, whose disk may be full, the test knows nothing.
    let healthy: Value = serde_json::from_slice(&run(&["--port", "sim", "doctor", "--json"]).stdout).expect("JSON");
    let failed = healthy["checks"].as_array().into_iter().flatten().filter(|check| check["verdict"] == "fail");
    assert!(failed.clone().all(|check| check["check"] == "disk"), "{healthy}");
    assert_eq!(healthy["failed"], failed.count());
    let verdict = |name: &str| {
        let checks = healthy["checks"].as_array().expect("a list");
        let check = checks.iter().find(|check| check["check"] == name).expect("the check was made");
        check["verdict"].as_str().expect("a verdict").to_owned()
    };
    for check in ["port", "versions", "start", "link", "clock", "state", "limits", "settings"] {
        assert_eq!(verdict(check), "pass", "{check} in {healthy}");
    }
    assert_eq!(verdict("reference"), "warn");
    let sick = run(&["--port", "/dev/nothing", "doctor"]);
    assert_eq!(sick.status.code(), Some(1));
    let said = text(&sick.stdout);
    assert!(said.contains("fail  port") && said.contains("-> connect and power the board"), "{said}");
}

#[test]
fn settings_are_shown_by_name_and_bad_ones_refused() {
    let axis = run_json(&["--port", "sim", "config", "get", "separation", "--json"]);
    assert_eq!(axis["separation.max"], "130deg");
    assert_eq!(axis["separation.counts_per_revolution"], 100_000);
    assert!(axis.get("baseline.max").is_none() && axis.get("baud").is_none());
    fails_with(&["--port", "sim", "config", "set", "baseline.speed", "40"], 2, &["baseline.speed", "40mm/s"]);
    fails_with(&["--port", "sim", "config", "set", "baseline.speed", "5m/s"], 2, &["cannot be 5m/s"]);
    fails_with(&["--port", "sim", "config", "set", "speed", "40mm/s"], 2, &["baseline.speed, separation.speed"]);
    fails_with(&["--port", "sim", "config", "set", "baseline.speed"], 2, &["VALUE"]);
    fails_with(&["--port", "sim", "config", "set", "--file", "/nowhere.toml"], 2, &["/nowhere.toml"]);
    fails_with(&["--port", "sim", "trigger", "--rate", "0"], 2, &["0.1 to 500"]);
    fails_with(&["--port", "sim", "trigger"], 2, &["--once"]);
}

#[test]
fn shells_learn_every_verb() {
    for shell in ["bash", "zsh", "fish"] {
        let output = run(&["completions", shell]);
        let script = text(&output.stdout);
        assert!(output.status.success() && VERBS.iter().all(|verb| script.contains(verb)), "{shell}");
    }
    fails_with(&["completions", "abacus"], 2, &["abacus", "bash"]);
}

#[test]
fn usage_errors_leave_with_2() {
    fails_with(&["fly"], 2, &["fly"]);
    fails_with(&["move"], 2, &["--baseline"]);
    fails_with(&["--port", "sim", "move", "--baseline", "120"], 2, &["120", "unit"]);
    fails_with(&["--port", "sim", "move", "--baseline", "500mm"], 2, &["500", "60", "220"]);
    fails_with(&["--port", "sim", "move", "--separation", "200deg"], 2, &["200", "130"]);
    fails_with(&["--port", "sim", "move", "--separation", "-5deg"], 2, &["-5", "130"]);
    fails_with(&["--port", "sim", "mode", "gecko"], 2, &["gecko", "herbivore", "human"]);
    fails_with(&["--lease", "1h", "--port", "sim", "home"], 2, &["20ms to 1s"]);
    fails_with(&["zones", "--baseline", "0mm", "--separation", "10deg"], 2, &["baseline"]);
    fails_with(&["zones", "--baseline", "145mm", "--separation", "10deg", "--radius", "50mm"], 2, &["circle"]);
}

#[test]
fn a_rig_file_is_checked_to_the_key() {
    let folder = temporary();
    let file = path(&folder, "rig.toml");
    let bench = vergence_rig::BENCH_TOML;
    let cases = [
        (bench.replace("[\"60mm\", \"220mm\"]", "[60, 220]"), "range"),
        (bench.replace("\"60mm\"", "\"60deg\""), "60deg"),
        (bench.replace("\"60mm\"", "\"-3000m\""), "100 m"),
        (bench.replace("name = \"bench\"", "name = \"bench\"\ncolour = \"red\""), "colour"),
        (bench.replace("separation = \"120deg\"", "separation = \"170deg\""), "170"),
        (bench.replace("separation = \"120deg\"", "twist = \"120deg\""), "twist"),
        (bench.replace("opencv_k1 = 0.01", "opencv_k1 = -0.9"), "turns over"),
        (bench.replace("fx = 366.0", "fx = 0.0"), "focal"),
        (bench.replace("counts_per_metre = 2000000", "counts_per_revolution = 2000000"), "counts_per_metre"),
        (bench.replace("kind = \"linear\"", "kind = \"linea"), "rig.toml"),
    ];
    for (toml, word) in cases {
        assert_ne!(toml, bench, "the case changes nothing");
        std::fs::write(&file, toml).expect("a rig file is written");
        fails_with(&["--port", "sim", "--rig", &file, "home"], 2, &["rig.toml", word]);
    }
    fails_with(&["--port", "sim", "--rig", "/nowhere/rig.toml", "home"], 2, &["/nowhere/rig.toml"]);
}

#[test]
fn a_bench_without_its_data_or_peers_says_so() {
    let folder = temporary();
    let bench = ["bench", "calibrate", "--shared", folder.path().to_str().expect("a name")];
    fails_with(&bench, 2, &["no calibration data", "VERGENCE_SHARED"]);
    let Some(shared) = common::real_data("data") else { return };
    let shared = shared.parent().expect("above it").to_string_lossy().into_owned();
    let bench = ["bench", "calibrate", "--shared", &shared, "--python", "/nowhere/python"];
    fails_with(&bench, 2, &["/nowhere/python", "--no-peer"]);
}

#[test]
fn a_target_is_svg_or_pdf_by_its_ending() {
    let folder = temporary();
    let target = |file: &str| {
        ["target", "--corners", "9x6", "--square", "25mm", "--out"]
            .map(str::to_owned)
            .into_iter()
            .chain([path(&folder, file)])
            .collect::<Vec<_>>()
    };
    for (file, start) in [("t.svg", "<svg"), ("t.pdf", "%PDF-1.4"), ("t.PDF", "%PDF-1.4")] {
        let arguments = target(file);
        let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(std::fs::read(folder.path().join(file)).expect("written").starts_with(start.as_bytes()), "{file}");
    }
    for file in ["t.png", "t"] {
        let arguments = target(file);
        fails_with(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), 2, &[file, ".svg or .pdf"]);
        assert!(!folder.path().join(file).exists());
    }
}

#[test]
fn a_verb_shows_only_the_options_that_act_on_it() {
    let help = |arguments: &[&str]| text(&run(arguments).stdout);
    let models = help(&["models", "list", "--help"]);
    for option in ["--lease", "--port", "--baud", "--rig"] {
        assert!(!models.contains(option), "{models}");
        assert!(help(&["config", "get", "--help"]).contains(option), "{option}");
    }
    assert!(!help(&["depth", "--help"]).contains("--port") && help(&["depth", "--help"]).contains("--rig"));
    assert!(help(&["flash", "--help"]).contains("--port") && !help(&["flash", "--help"]).contains("--lease"));
    fails_with(&["models", "list", "--lease", "1s"], 2, &["--lease"]);
    let overview = help(&["--help"]);
    let at = |word: &str| overview.find(word).unwrap_or_else(|| panic!("{word} is missing: {overview}"));
    assert!(at("Calibrate:") < at("  capture ") && at("  capture ") < at("Move:") && at("Move:") < at("  home "));
    assert_eq!(overview, help(&["help"]));
    assert_eq!(help(&["help", "config", "get"]), help(&["config", "get", "--help"]));
}

#[test]
fn a_failure_is_json_where_results_are() {
    for arguments in [&["--json", "--rig", "/nowhere/rig.toml", "mode", "human"][..], &["depth", "--json"]] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2));
        let said: serde_json::Value = serde_json::from_slice(&output.stderr).expect("JSON");
        assert_eq!(said["error"]["kind"], "usage", "{said}");
        assert_eq!(said["error"]["exit_code"], 2, "{said}");
        assert!(said["error"]["message"].as_str().is_some_and(|message| message.len() > 20), "{said}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn without_cameras_or_reference_nothing_is_measured() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let pair = folder.path().join("pair.toml");
    let fixed = include_str!("../docs/rig-file.md").split("```").nth(1).expect("the first example");
    let camera =
        fixed.split("[right.camera]").next().expect("a camera").split("[left.camera]").nth(1).expect("a camera");
    let right = fixed.replace("# the same keys", camera);
    std::fs::write(&pair, right.trim_start_matches("toml")).expect("written");
    let pair = pair.to_str().expect("a name");
    let cameras = ["run", "--cameras", "/nowhere/video0", "/nowhere/video1"];
    fails_with(&[&["--rig", pair], &cameras[..]].concat(), 3, &["there is no camera", "/nowhere/video1"]);
    fails_with(&["--port", "sim", "run", "--cameras", "sim", "--frames", "1"], 3, &["no reference", "--home"]);
    fails_with(&["--port", "sim", "run", "--cameras", "/dev/video0", "/dev/video1"], 2, &["--cameras sim"]);
    fails_with(&["--port", "sim", "run", "--cameras", "sim", "--mode", "cat"], 2, &["herbivore or human"]);
}
