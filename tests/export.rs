//! Exports for other programs, read by other programs: OpenCV, rosbags, ruamel.yaml. Board, stages and cameras are simulated.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::path::Path;
use std::process::{Command, Stdio};

use common::pairs::{human, refs, write_rig};
use common::{fails_with, python, run, run_json, signal, small_bench_toml, text, vergence};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};
use vergence_rig::{BENCH_TOML, Rig};
use vergence_scene::{Optics, Scene, Target, View, render};
use vergence_vision::{Camera, KannalaBrandt, Length, Transform, World};

/// What a script of `tests/export` prints as JSON; `None` without the libraries that it uses.
fn said(script: &str, arguments: &[&str]) -> Option<Value> {
    let python = python("import cv2, rosbags, ruamel.yaml", "opencv-contrib-python-headless rosbags")?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/export").join(script);
    let output = Command::new(python).arg(script).args(arguments).output().expect("python runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("{said}");
    Some(said)
}

/// A folder, and the names of files in it.
struct Work(tempfile::TempDir);

impl Work {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn file(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    /// A recording of the small bench, which moves meanwhile.
    fn recording(&self) -> String {
        let (rig, recording) = (self.file("small.toml"), self.file("recording"));
        std::fs::write(&rig, small_bench_toml()).expect("a rig file");
        let board = ["--port", "sim", "--rig", &rig, "record", "--cameras", "sim", "--home", "--rate", "5"];
        let output = run(&[&board[..], &["--mode", "herbivore", "--frames", "5", "--out", &recording]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        recording
    }
}

#[test]
fn a_recording_becomes_folders_and_views_that_other_programs_read() {
    let work = Work::new();
    let recording = work.recording();
    let [tum_vi, euroc, views] = ["tum-vi", "euroc", "views"].map(|name| work.file(name));
    for (to, out) in [("tum-vi", &tum_vi), ("euroc", &euroc), ("pinhole", &views)] {
        let output = run(&["export", &recording, "--to", to, "--out", out, "--json"]);
        let warned = text(&output.stderr);
        assert!(output.status.success(), "{warned}");
        let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!((&result["pairs"], &result["without_pose"]), (&json!(5), &json!(0)), "{result}");
        assert_eq!(warned.contains("the cameras moved"), to != "pinhole", "{warned}");
    }
    ours_measures(&work, &tum_vi);
    if let Some(said) = said("sequence.py", &[&recording, &tum_vi, &euroc, &views]) {
        let number = |name: &str| said[name].as_f64().expect("a number");
        assert_eq!(said["images"], 10);
        // The bench moved from one pose to another while it was recorded, and the encoders say the same.
        assert!(number("moved_m") > 0.005 && number("encoder_off") < 0.02, "{said}");
        assert!(number("front_off") < 1.0 && number("frames_off") < 1e-12, "{said}");
    }

    fails_with(&["export", &recording, "--to", "tum-vi", "--out", &tum_vi], 2, &["there is something already"]);
    for (bytes, words) in [(&b"no recording"[..], "this is no recording"), (b"\x89MCAP0\r\nno more", "its beginning")] {
        let junk = work.file("junk.mcap");
        std::fs::write(&junk, bytes).expect("written");
        fails_with(&["export", &junk, "--to", "tum-vi", "--out", &work.file("junk")], 2, &["junk.mcap", words]);
        fails_with(&["replay", &junk], 2, &["junk.mcap", words]);
    }
    let new = work.file("new");
    let export = |more: &[&str], words: &[&str]| {
        fails_with(&[&["export", &recording, "--out", &new][..], more].concat(), 2, words);
        assert!(!Path::new(&new).exists(), "{more:?}");
    };
    export(&["--to", "tum-vi", "--faces", "front"], &["--faces, --field and --size are for pinhole views"]);
    export(&["--to", "euroc", "--faces", "left"], &["the front view"]);
    export(&["--to", "pinhole", "--field", "180deg"], &["10° to 150°"]);
    export(&["--to", "pinhole", "--faces", "back"], &["'back' is no view"]);
    export(&["--to", "e57"], &["'e57' is not written"]);
    fails_with(&["export", &work.file("none"), "--to", "euroc", "--out", &new], 2, &["cannot be read"]);
    let large = work.file("large.toml");
    std::fs::write(&large, BENCH_TOML).expect("a rig file");
    let other = ["export", &recording, "--to", "tum-vi", "--rig", &large, "--out", &new];
    fails_with(&other, 2, &["320 x 320", "1280 x 1280"]);
}

/// Our own program measures the last pair of the folder, at the pose that the folder states.
fn ours_measures(work: &Work, folder: &str) {
    let table = std::fs::read_to_string(Path::new(folder).join("mav0/stage0/data.csv")).expect("a table");
    let last: Vec<&str> = table.lines().last().expect("a line").split(',').collect();
    let metres = |column: usize| last[column].parse::<f64>().expect("a number");
    let (baseline, separation) = (format!("{}mm", metres(4) * 1000.0), format!("{}rad", metres(6)));
    let image = |camera: &str| format!("{folder}/mav0/{camera}/data/{}.png", last[0]);
    let (left, right, rig) = (image("cam0"), image("cam1"), format!("{folder}/rig.toml"));
    let pair = ["depth", "--rig", &rig, "--left", &left, "--right", &right, "--out", &work.file("cloud.ply")]
        .map(str::to_owned);
    let result =
        run_json(&[&refs(&pair)[..], &["--baseline", &baseline, "--separation", &separation, "--json"]].concat());
    println!("{} points", result["points"]);
    assert!(result["points"].as_u64().is_some_and(|points| points > 30), "{result}");
}

/// Targets in front of the cameras and beside them, up to 93° from the axis, are in the views where K R X says.
#[test]
fn corners_of_targets_are_where_the_files_of_the_views_say() {
    let work = Work::new();
    let rig = Rig::from_toml(BENCH_TOML).expect("the bench");
    write_rig(&rig, Path::new(&work.file("rig.toml")));
    let target = Target { columns: 6, rows: 4, square: Length::from_mm(20.0) };
    // The world is the frame of the left camera.
    let ahead: Transform<World, Target> =
        target.placed(UnitQuaternion::from_euler_angles(0.1, 0.2, 0.1), Vector3::new(180.0, -60.0, 450.0));
    let beside: Transform<World, Target> = target.placed(
        UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::FRAC_PI_2),
        Vector3::new(500.0, 10.0, 20.0),
    );
    let scene = Scene::target_alone(target, ahead).with_target(target, beside);
    let left_from_right = human(&rig).left_from_right.renamed::<World, Camera>();
    let right_from_world = left_from_right.inverse();
    photograph(
        &scene,
        &rig.left_camera,
        Transform::from_isometry(nalgebra::Isometry3::identity()),
        &work.file("left/taken.png"),
    );
    photograph(&scene, &rig.right_camera, left_from_right, &work.file("right/taken.png"));

    let (left, right, out) = (work.file("left"), work.file("right"), work.file("views"));
    let pinhole =
        ["export", &left, &right, "--rig", &work.file("rig.toml"), "--to", "pinhole", "--out", &out].map(str::to_owned);
    let result = run_json(&[&refs(&pinhole)[..], &["--faces", "front,right", "--json"]].concat());
    assert_eq!(result["pairs"], 1, "{result}");
    let corners = |place: &Transform<World, Target>| {
        let all = (0..4).flat_map(|row| (0..6).map(move |column| (column, row)));
        all.map(|(column, row)| *place * target.corner(column, row)).collect::<Vec<_>>()
    };
    let in_left = |place| corners(place).iter().map(|point| point.mm().into()).collect::<Vec<[f64; 3]>>();
    let in_right: Vec<[f64; 3]> = corners(&ahead).iter().map(|point| (right_from_world * *point).mm().into()).collect();
    let boards = json!({ "left/front": in_left(&ahead), "left/right": in_left(&beside), "right/front": in_right });
    if let Some(said) = said("corners.py", &[&out, &boards.to_string()]) {
        for view in ["left/front", "left/right", "right/front"] {
            assert_eq!(said[view]["corners"], 24);
            assert!(said[view]["worst_px"].as_f64().is_some_and(|worst| worst < 0.3), "{view}: {said}");
        }
        assert!(said["left/right"]["largest_angle_deg"].as_f64().is_some_and(|angle| angle > 93.0), "{said}");
    }
    let euroc = ["export", &left, &right, "--to", "euroc", "--out", &work.file("euroc")];
    fails_with(&euroc, 2, &["which image files do not tell"]);
    fails_with(&["export", &left, &right, "--to", "pinhole", "--out", &work.file("new")], 2, &["--rig"]);
}

/// Ctrl-C amid many images: nothing is left of the folder, and nothing beside it.
#[test]
fn an_export_that_is_interrupted_leaves_nothing() {
    let work = Work::new();
    let (rig, around, out) = (work.file("small.toml"), work.file("around"), work.file("around/views"));
    std::fs::write(&rig, small_bench_toml()).expect("a rig file");
    let grey = image::RgbImage::from_pixel(320, 320, image::Rgb([90; 3]));
    let folders = ["left", "right"].map(|side| work.file(side));
    for folder in &folders {
        std::fs::create_dir_all(folder).expect("a folder");
        let first = Path::new(folder).join("0000.png");
        grey.save(&first).expect("written");
        (1..1000).for_each(|number| {
            std::fs::hard_link(&first, Path::new(folder).join(format!("{number:04}.png"))).expect("linked");
        });
    }
    let arguments = ["export", &folders[0], &folders[1], "--rig", &rig, "--to", "pinhole", "--out", &out];
    let mut child = vergence(&arguments).stderr(Stdio::piped()).spawn().expect("it starts");
    let begun = || std::fs::read_dir(&around).is_ok_and(|mut entries| entries.next().is_some());
    while !begun() {
        assert!(child.try_wait().expect("a child").is_none(), "it ended before it was interrupted");
        std::thread::yield_now();
    }
    signal(child.id(), "-INT");
    let output = child.wait_with_output().expect("it ends");
    let said = text(&output.stderr);
    assert!(output.status.code() == Some(3) && said.contains("interrupted: nothing is written to"), "{said}");
    assert!(!begun(), "something is left");
}

fn photograph(scene: &Scene, camera: &KannalaBrandt, world_from_camera: Transform<World, Camera>, path: &str) {
    std::fs::create_dir_all(Path::new(path).parent().expect("a folder")).expect("it is made");
    let view = View { scene, camera, world_from_camera, optics: &Optics::default() };
    render(&view, 1).image.save(path).expect("a photograph is written");
}
