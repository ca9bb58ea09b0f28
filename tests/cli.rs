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
    "arm",
    "disarm",
    "clear",
    "home",
    "mode",
    "move",
    "plan",
    "stop",
    "monitor",
    "sim",
    "demo",
    "depth",
    "zones",
    "capture",
    "calibrate",
    "camera",
    "target",
    "bench",
    "soak",
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
    fails_with(&["--port", "sim", "mode", "human"], 3, &["no reference", "vergence home"]);
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
    for method in ["pseudo-intersection", "midpoint", "mid2", "angular-l1", "angular-linf", "reprojection", "rectified"]
    {
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
}
