//! Pairs calibrated by the command line from a target that looks the same after half a turn.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::path::Path;

use common::{run, run_json, text};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_rig::{CameraDocument, CameraMask, CameraTable, Rig};
use vergence_scene::{Optics, Target};
use vergence_sim::photograph_target;
use vergence_vision::{Camera, KannalaBrandt, Length, Transform, World};

/// Eight by six corners: the squares look alike after half a turn.
const TARGET: Target = Target { columns: 8, rows: 6, square: Length::from_mm(20.0) };
const SIZES: [&str; 4] = ["--corners", "8x6", "--square", "20mm"];

/// A small lens past 90°, so that rendering is quick.
fn lens() -> KannalaBrandt {
    let small = vergence_rig::BENCH_TOML.replace("[1280, 1280]", "[640, 640]");
    let small = small.replace("366.0", "183.0").replace("639.5", "319.5");
    Rig::from_toml(&small).expect("a rig").left_camera
}

/// The right camera stands 120 mm to the right, on its head: what is upright in one image is not in the other.
fn left_from_right() -> Transform<World, Camera> {
    let on_its_head = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::PI);
    Transform::new(
        on_its_head * UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.1, 0.0)),
        Vector3::new(120.0, 5.0, -3.0),
    )
}

/// Writes the pair's images of a target that is held in these ways (turns about its axes, place), and the camera file.
fn write_pair(folder: &Path, held: &[([f64; 3], [f64; 3])]) {
    let (lens, optics) = (lens(), Optics { samples: 1, edge_samples: 40, ..Optics::default() });
    let upright = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    for (index, (turns, place)) in held.iter().enumerate() {
        let rotation = UnitQuaternion::from_euler_angles(turns[0], turns[1], turns[2]);
        let at: Transform<World, Target> = TARGET.placed(rotation, Vector3::from(*place));
        for (name, world_from_camera, seed) in [("left", upright, 1), ("right", left_from_right(), 2)] {
            let image = photograph_target(TARGET, at, &lens, world_from_camera, &optics, seed + 10 * index as u64);
            image.save(folder.join(format!("{name}{index:03}.png"))).expect("an image is written");
        }
    }
    let camera = CameraDocument { camera: CameraTable::of(&lens), calibration: None, provenance: None };
    std::fs::write(folder.join("lens.toml"), toml::to_string(&camera).expect("TOML")).expect("written");
}

fn arguments(folder: &Path) -> Vec<String> {
    let file = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let words = ["calibrate", "extrinsics", "--json", "--left-images"].map(str::to_owned);
    let files = [file("left*.png"), "--right-images".into(), file("right*.png"), "--left".into(), file("lens.toml")];
    let more = ["--right".into(), file("lens.toml"), "--report".into(), file("report.html")];
    words.into_iter().chain(files).chain(more).chain(SIZES.map(str::to_owned)).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|number| number.as_f64().expect("a number")).collect()
}

#[test]
fn a_pair_with_a_camera_on_its_head_is_calibrated_from_a_target_that_looks_alike_upside_down() {
    let work = tempfile::tempdir().expect("a folder");
    let held = [
        ([0.3, 0.2, 0.4], [20.0, 10.0, 260.0]),
        ([-0.4, 0.3, -0.9], [120.0, -40.0, 280.0]),
        ([0.2, -0.5, 1.5], [-60.0, 60.0, 270.0]),
        ([0.5, 0.1, 2.4], [60.0, 110.0, 300.0]),
        ([-0.2, -0.4, -2.2], [90.0, -110.0, 290.0]),
    ];
    write_pair(work.path(), &held);
    let arguments = arguments(work.path());
    let (mask, out) = (work.path().join("mask.toml"), work.path().join("pair.toml"));
    std::fs::write(&mask, "[[shape]]\nhides = \"inside\"\ncircle = [5, 5, 4]\n").expect("written");
    let (mask, out) = (mask.to_string_lossy(), out.to_string_lossy());
    let more = ["--left-mask", &mask, "--out", &out];
    let found = run_json(&arguments.iter().map(String::as_str).chain(more).collect::<Vec<_>>());
    println!("{}", found["joint"]);
    let rig = Rig::from_toml(&std::fs::read_to_string(&*out).expect("a rig file")).expect("a rig");
    assert_eq!(rig.masks, [Some(CameraMask::File(mask.as_ref().into())), None], "the file names the mask of its views");
    let truth = left_from_right();
    let shift = Vector3::from_vec(numbers(&found["joint"]["translation_mm"])) - truth.origin().mm();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from_vec(numbers(&found["joint"]["rotation_vector"])));
    let turn = turn.angle_to(&truth.rotation()).to_degrees();
    assert!(shift.norm() < 1.0 && turn < 0.2, "{} mm and {turn}° off", shift.norm());
    assert_eq!((&found["views_used"], &found["left_out"]), (&Value::from(5), &Value::from(Vec::<Value>::new())));
}

/// Nothing in the images tells the labels: the target never turns. The views are left out and the reason is told.
#[test]
fn views_whose_labels_stay_open_are_left_out_and_told() {
    let work = tempfile::tempdir().expect("a folder");
    let same = ([0.3, 0.2, 0.4], [20.0, 10.0, 260.0]);
    write_pair(work.path(), &[same; 4]);
    let arguments = arguments(work.path());
    let output = run(&arguments.iter().map(String::as_str).chain(["--force"]).collect::<Vec<_>>());
    let said = text(&output.stderr);
    println!("{said}");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said.contains("left003.png: left out: its image allows several labellings") && said.contains("more than one")
    );
    assert!(said.contains("0 views"), "{said}");
}
