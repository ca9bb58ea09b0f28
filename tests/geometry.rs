//! Zones, poses for a goal, and the speed of kernels and live matching, on the command line.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use common::{fails_with, run, run_json, text};

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

fn drawing(path: &str) -> String {
    let svg = std::fs::read_to_string(path).expect("an SVG");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{path}");
    svg
}

#[test]
fn zones_of_a_mode_are_those_of_its_lenses() {
    let zones = run_json(&["zones", "--mode", "herbivore", "--json"]);
    assert!((zones["exact"]["stereo"].as_f64().expect("degrees") - 57.15).abs() < 0.01, "{zones}");
    let sum: f64 = ["stereo", "mono", "blind"].iter().filter_map(|zone| zones["solid_sr"][zone].as_f64()).sum();
    assert!((sum - 4.0 * std::f64::consts::PI).abs() < 1e-3, "{zones}");
    let human = run_json(&["zones", "--mode", "human", "--json"]);
    assert!(human["rear_overlap"].as_f64().expect("degrees") > 10.0, "{human}");
}

#[test]
fn what_the_body_hides_is_not_seen() {
    let folder = temporary();
    let (mask, small) = (path(&folder, "mask.png"), path(&folder, "small.png"));
    // The left half of the left image shows the robot.
    let picture = image::GrayImage::from_fn(1280, 1280, |x, _| image::Luma([if x < 640 { 0 } else { 255 }]));
    picture.save(&mask).expect("a picture is written");
    image::GrayImage::new(64, 64).save(&small).expect("a picture is written");
    let open = run_json(&["zones", "--mode", "human", "--json"]);
    let hidden = run_json(&["zones", "--mode", "human", "--left-mask", &mask, "--json"]);
    let stereo = |zones: &serde_json::Value| zones["solid_sr"]["stereo"].as_f64().expect("steradians");
    assert!(stereo(&hidden) < 0.65 * stereo(&open), "{hidden}");
    fails_with(&["zones", "--mode", "human", "--left-mask", &small], 2, &["its camera 1280 x 1280"]);
    fails_with(&["zones", "--mode", "cat"], 2, &["no mode 'cat'"]);
}

#[test]
fn zones_draw_their_curves() {
    let folder = temporary();
    let svg = path(&folder, "curves.svg");
    run_json(&["zones", "--baseline", "145mm", "--separation", "120deg", "--plot", &svg, "--json"]);
    let curves = drawing(&svg);
    // Three exact and three published curves in each of both diagrams.
    assert!(curves.matches("<polyline").count() >= 12);
    assert_eq!(curves.matches("stroke-dasharray").count(), 6);
    // Those of a mode are those of two equal cameras at its baseline and separation.
    run_json(&["zones", "--mode", "herbivore", "--plot", &svg, "--json"]);
    assert!(drawing(&svg).contains("baseline 145 mm"), "{}", drawing(&svg));
    fails_with(&["zones", "--mode", "herbivore", "--svg", "zones.pdf"], 2, &["'.pdf' is not written", ".svg"]);
}

#[test]
fn a_depth_goal_finds_its_pose_before_anything_moves() {
    let folder = temporary();
    let svg = path(&folder, "field.svg");
    let goal = "sigma_z <= 1mm at 350mm over +-40deg";
    let best = run_json(&["plan", "--goal", goal, "--depth-field", &svg, "--json"]);
    assert_eq!(best["meets_goal"], true);
    assert!(best["worst_sigma_mm"].as_f64().expect("mm") <= 1.0, "{best}");
    assert!(best["stereo_deg"].as_f64().expect("degrees") >= 80.0, "{best}");
    assert!(best["seen_deg"].as_f64().expect("degrees") > 285.0, "{best}");
    let field = drawing(&svg);
    assert!(field.contains("rgb(") && field.contains("Predicted depth error at baseline"), "a title");
    assert!(field.contains(">350 mm<") || field.contains(">525 mm<"), "range rings");
    assert!(field.contains(">90°<") && field.contains(">-90°<"), "angles");
    let impossible = run(&["plan", "--goal", "sigma_z <= 1um at 3m over +-40deg"]);
    assert_eq!(impossible.status.code(), Some(1), "{}", text(&impossible.stdout));
    fails_with(&["plan", "--goal", "as good as possible"], 2, &["is no goal"]);
}

#[test]
fn the_bench_of_the_kernels_does_without_opencv() {
    let figures =
        run_json(&["bench", "vision", "--points", "2000", "--repeats", "3", "--python", "/nonexistent", "--json"]);
    assert!(figures["opencv"].is_null());
    assert!(figures["max_ray_error_rad"].as_f64().expect("radians") <= 1e-14, "{figures}");
    for figure in ["project_ns", "unproject_ns", "triangulate_mpts_per_s", "triangulate_full_mpts_per_s"] {
        assert!(figures[figure].as_f64().expect("a number") > 0.0, "{figures}");
    }
    assert!(figures["anew"]["triangulate_full_ns"].as_f64().expect("a number") > 0.0, "{figures}");
}

#[test]
fn bench_live_accounts_for_every_pair() {
    let figures = run_json(&["bench", "live", "--sides", "240", "--pairs", "8", "--rate", "30", "--no-peer", "--json"]);
    let rows = figures["rows"].as_array().expect("rows");
    assert_eq!(
        rows.iter().map(|row| row["way"].as_str()).collect::<Vec<_>>(),
        [Some("human"), Some("herbivore"), Some("turning")]
    );
    for row in rows {
        let number = |key: &str| row["live"][key].as_f64().expect("a number");
        assert!((number("measured") + number("skipped") - 8.0).abs() < 0.5 && number("measured") > 0.5, "{row}");
        assert!(number("precision") > 0.97 && number("right_points") > 20.0, "{row}");
        assert!(number("latency_99_ms") >= number("latency_median_ms") && number("rate_hz") > 0.0, "{row}");
        let dense = |key: &str| row["live"]["dense"][key].as_f64().expect("a number");
        assert!((dense("came") - 8.0).abs() < 0.5 && dense("skipped") < 8.0 && dense("share") > 0.1, "{row}");
        // An encoder that flickers by a count turns no views; stages that turn do.
        let is_standing = row["way"] != "turning";
        assert_eq!(number("kept_views") >= number("measured") - 1.5, is_standing, "{row}");
    }
}

#[test]
fn bench_live_measures_the_cases_that_are_asked_for() {
    let case = ["bench", "live", "--sides", "160", "--pairs", "1", "--cases", "herbivore", "--no-peer", "--json"];
    let figures = run_json(&case);
    assert_eq!(figures["rows"].as_array().map(Vec::len), Some(1));
    assert_eq!(figures["rows"][0]["way"], "herbivore");
    fails_with(&["bench", "live", "--cases", "cat"], 2, &["herbivore"]);
}
