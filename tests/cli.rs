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

const VERBS: &[&str] = &[
    "devices",
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
    "run",
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
];

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

/// A small grey picture with some texture.
fn picture(path: &str, width: u32, height: u32) {
    image::RgbImage::from_fn(width, height, |x, y| image::Rgb([((x * 7 + y * 13) % 251) as u8; 3]))
        .save(path)
        .expect("a picture is written");
}

/// A pair whose pose is fixed, for 64 x 48 images.
const SMALL_RIG: &str = r#"
name = "small"
[left.camera]
size = [64, 48]
fx = 20.0
fy = 20.0
cx = 31.5
cy = 23.5
opencv_k1 = 0.0
opencv_k2 = 0.0
opencv_k3 = 0.0
opencv_k4 = 0.0
[right.camera]
size = [64, 48]
fx = 20.0
fy = 20.0
cx = 31.5
cy = 23.5
opencv_k1 = 0.0
opencv_k2 = 0.0
opencv_k3 = 0.0
opencv_k4 = 0.0
[right.at_zero]
origin = ["100mm", "0mm", "0mm"]
rotation_vector = ["0deg", "0deg", "0deg"]
"#;

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
fn the_readme_names_every_verb_and_no_other() {
    let readme =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md")).expect("README");
    let table: Vec<_> = readme.lines().filter_map(|line| line.strip_prefix("| `")?.split(['`', ' ']).next()).collect();
    assert_eq!(table, VERBS);
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
        "baseline    60.000 mm -> 145.000 mm, at most 45.454 mm/s",
        "takes 2.310 s within the limits of native-sim",
        "     0.00000      60.0000       0.0000        0.000       1467.4",
        "     2.31001     145.0000       0.0000        0.000          0.0",
        "     0.31000       9.3000      59.9998        0.000          0.0",
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
    let healthy = run_json(&["--port", "sim", "doctor", "--json"]);
    assert_eq!(healthy["failed"], 0);
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
fn depth_refuses_bad_images_and_leaves_no_file() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    let (rig, out) = (file("rig.toml"), file("cloud.ply"));
    std::fs::write(&rig, SMALL_RIG).expect("a rig file is written");
    picture(&file("good.png"), 64, 48);
    picture(&file("wide.png"), 65, 48);
    let whole = std::fs::read(file("good.png")).expect("just written");
    std::fs::write(file("cut.png"), &whole[..whole.len() / 2]).expect("half a picture is written");
    picture(&file("good.jpg"), 64, 48);
    let whole = std::fs::read(file("good.jpg")).expect("just written");
    std::fs::write(file("cut.jpg"), &whole[..whole.len() - 20]).expect("most of a picture is written");
    std::fs::write(file("bad.csv"), "u_left,v_left,u_right\n1,2,3\n").expect("written");
    let good = file("good.png");
    let depth = |left: &str, right: &str, more: &[&str], words: &[&str]| {
        let pair = ["depth", "--rig", &rig, "--left", left, "--right", right, "--out", &out];
        fails_with(&[&pair, more].concat(), 2, words);
        assert!(!Path::new(&out).exists(), "an output file was left behind");
    };
    depth(&file("missing.png"), &good, &[], &["missing.png"]);
    depth(&good, &file("cut.png"), &[], &["cut.png", "not a readable image"]);
    // Decoders fill what a JPEG lacks with grey.
    depth(&good, &file("cut.jpg"), &[], &["cut.jpg", "ends before"]);
    depth(&good, &file("wide.png"), &[], &["wide", "65 x 48", "64 x 48"]);
    depth(&good, &good, &["--points", &file("bad.csv")], &["bad.csv", "v_right"]);
    depth(&good, &good, &["--separation", "10deg"], &["separation"]);
    depth(&good, folder.path().to_str().expect("a name"), &[], &["must pair up"]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 7, "only the inputs are there");
}

#[test]
fn depth_of_given_correspondences() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    std::fs::write(file("rig.toml"), SMALL_RIG).expect("a rig file is written");
    picture(&file("grey.png"), 64, 48);
    // Equidistant, 20 px/rad, 100 mm apart: 45° on the left and straight ahead on the right meet at (100, 0, 100).
    let column = 31.5 + 20.0 * std::f64::consts::FRAC_PI_4;
    std::fs::write(
        file("pairs.csv"),
        format!("u_left,v_left,u_right,v_right\n{column},23.5,31.5,23.5\n31.5,23.5,60,23.5\n"),
    )
    .expect("written");
    let (rig, grey, pairs, out) = (file("rig.toml"), file("grey.png"), file("pairs.csv"), file("cloud.ply"));
    let options = ["--rig", &rig, "--left", &grey, "--right", &grey, "--points", &pairs, "--out", &out];
    // Exact rays meet in one point by every method.
    let methods =
        ["pseudo-intersection", "midpoint", "mid2", "angular-l1", "angular-linf", "reprojection", "rectified"];
    for method in methods.into_iter().chain(["edge-plane:0,1,0"]) {
        let result = run_json(&[&["depth", "--json", "--kernel", method], &options[..]].concat());
        assert_eq!(result["points"], 1, "{method}: {result}");
        assert_eq!(result["dropped"]["diverging"], 1, "{method}: {result}");
        assert!(result["pose_drift"].is_null(), "two pairs say nothing of the pose");
        let cloud = std::fs::read_to_string(&out).expect("a cloud");
        let (header, body) = cloud.split_once("end_header\n").expect("a PLY header");
        assert!(header.contains("element vertex 1") && header.contains("property double u_left"));
        let numbers: Vec<f64> = body.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        for (got, expected) in numbers.iter().zip([100.0, 0.0, 100.0]) {
            assert!((got - expected).abs() < 0.01, "{method}: {numbers:?}");
        }
    }
    fails_with(&[&["depth", "--kernel", "guess"], &options[..]].concat(), 2, &["guess", "midpoint"]);
    run_json(&[&["depth", "--json", "--also", "csv,json"], &options[..]].concat());
    let csv = std::fs::read_to_string(file("cloud.csv")).expect("a table");
    let row: Vec<f64> =
        csv.lines().nth(1).expect("a row").split(',').map(|number| number.parse().expect("a number")).collect();
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file("cloud.json")).expect("a table")).expect("JSON");
    assert!(csv.starts_with("x_mm,y_mm,z_mm,red,green,blue,u_left") && csv.lines().count() == 2, "{csv}");
    assert_eq!(
        (json["columns"][10].as_str(), json["rows"][0].as_array().map(Vec::len)),
        (Some("sigma_range_mm"), Some(18))
    );
    assert!((row[0] - 100.0).abs() < 0.01 && (row[2] - 100.0).abs() < 0.01, "{row:?}");
    // The variance of the range, along (1, 0, 1): half of xx and zz, and xz.
    let along = (0.5 * (row[12] + row[17]) + row[14]).sqrt();
    assert!((along / row[10] - 1.0).abs() < 1e-3, "{along} {}", row[10]);
}

#[test]
fn dense_depth_refuses_bad_input_and_says_where_nothing_is_seen() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    let (rig, together, out) = (file("rig.toml"), file("together.toml"), file("cloud.ply"));
    std::fs::write(&rig, SMALL_RIG).expect("a rig file is written");
    std::fs::write(&together, SMALL_RIG.replace("\"100mm\"", "\"0mm\"")).expect("a rig file is written");
    picture(&file("good.png"), 64, 48);
    picture(&file("wide.png"), 65, 48);
    image::RgbImage::new(64, 48).save(file("black.png")).expect("a picture is written");
    let (good, wide, black) = (file("good.png"), file("wide.png"), file("black.png"));
    let depth = |rig: &str, left: &str, right: &str, more: &[&str], code: i32, words: &[&str]| {
        let pair = ["depth", "--dense", "--rig", rig, "--left", left, "--right", right, "--out", &out];
        fails_with(&[&pair, more].concat(), code, words);
    };
    depth(&rig, &good, &wide, &[], 2, &["wide", "65 x 48", "64 x 48"]);
    depth(&together, &good, &good, &[], 2, &["no baseline"]);
    depth(&rig, &good, &good, &["--points", "pairs.csv"], 2, &["--dense", "--points"]);
    depth(&rig, &good, &good, &["--matcher", "guided"], 2, &["--dense", "--matcher"]);
    assert!(!Path::new(&out).exists(), "an output file was left behind");
    depth(&rig, &black, &black, &[], 1, &["no pixel of black has a range", "dark"]);
    let ranges = image::open(file("cloud-range.png")).expect("the range image is written").into_luma16();
    assert!(ranges.dimensions() == (64, 48) && ranges.pixels().all(|range| range.0 == [0]));
    for name in ["cloud.ply", "cloud-sigma.png", "cloud-confidence.png", "cloud-preview.png"] {
        assert!(Path::new(&file(name)).exists(), "{name} is written");
    }
}

#[test]
fn a_bench_without_its_data_or_peers_says_so() {
    let folder = temporary();
    let bench = ["bench", "calibrate", "--shared", folder.path().to_str().expect("a name")];
    fails_with(&bench, 2, &["no calibration data", "VERGENCE_SHARED"]);
    let Some(shared) = common::shared("data") else { return };
    let shared = shared.parent().expect("above it").to_string_lossy().into_owned();
    let bench = ["bench", "calibrate", "--shared", &shared, "--python", "/nowhere/python"];
    fails_with(&bench, 2, &["/nowhere/python", "--no-peer"]);
}
