//! OpenCV as an independent reference for targets with tags: near the axis of a lens, where it works.
//!
//! The interpreter is `python3`, or that of `VERGENCE_PYTHON`. Without OpenCV's module (`python3 -m pip install
//! opencv-contrib-python-headless`) the tests print `SKIPPED`; with `VERGENCE_REQUIRE_DATA=1` they fail.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::path::Path;
use std::process::Command;

use common::data::say_skipped;
use image::imageops::grayscale;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_calibration_input::printed;
use vergence_scene::{Optics, Target};
use vergence_sim::photograph_target;
use vergence_targets::{AprilGridSpec, TargetKind, detect_april_grid};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform, World};

/// The interpreter, if it has the module; else the test is skipped, or fails where data are required.
fn python() -> Option<String> {
    let python = std::env::var("VERGENCE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let asked = Command::new(&python).args(["-c", "import cv2; cv2.aruco.ArucoDetector"]).output();
    if asked.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    let why = format!(
        "{python} has no module cv2 with aruco: install it with '{python} -m pip install opencv-contrib-python-headless'"
    );
    let required = std::env::var_os("VERGENCE_REQUIRE_DATA").is_some_and(|value| value == "1");
    assert!(!required, "VERGENCE_REQUIRE_DATA=1, but {why}");
    say_skipped(&why);
    None
}

fn run(python: &str, script: &str, arguments: &[&str]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/opencv_targets").join(script);
    let output = Command::new(python).arg(script).args(arguments).output().expect("python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn lens() -> KannalaBrandt {
    let centre = Pixel { u: 640.0, v: 478.0 };
    let size = ImageSize { width: 1280, height: 960 };
    KannalaBrandt::new([700.0, 4.0, -1.5, 0.4, -0.08], 1.0, centre, Angle::from_deg(60.0), size).expect("a lens")
}

/// Where the target is held near the axis.
fn place(target: &TargetKind) -> Transform<World, Target> {
    let rotation = UnitQuaternion::from_euler_angles(0.25, -0.2, 0.3);
    printed(target).placed(rotation, Vector3::new(10.0, -5.0, 330.0))
}

/// Its photograph.
fn photograph(target: &TargetKind) -> image::GrayImage {
    let (sheet, place) = (printed(target), place(target));
    let upright = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    let optics = Optics { samples: 1, edge_samples: 40, blur_px: 0.7, ..Optics::default() };
    grayscale(&photograph_target(sheet, place, &lens(), upright, &optics, 1))
}

#[test]
fn tags_are_the_same_and_their_corners_near() {
    let Some(python) = python() else { return };
    let grid = AprilGridSpec { columns: 6, rows: 5, tag: Length::from_mm(24.0), spacing: 0.3 };
    let image = photograph(&TargetKind::AprilGrid(grid));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("grid.png");
    image.save(&file).expect("an image is written");
    let theirs = run(&python, "tags.py", &[&file.to_string_lossy()]);
    let theirs = theirs.as_array().expect("tags");
    let ours = detect_april_grid(&image, &grid, Some(&lens())).expect("a grid");
    assert_eq!((ours.len(), theirs.len()), (120, 30));
    let (mut apart, mut ours_off, mut theirs_off) = (Vec::new(), Vec::new(), Vec::new());
    let distance = |a: Pixel, b: Pixel| (a.u - b.u).hypot(a.v - b.v);
    for tag in theirs {
        let id = tag["id"].as_u64().expect("a number") as u32;
        for (turn, corner) in (0..4).zip(tag["corners"].as_array().expect("corners")) {
            // Clockwise from the lower right: OpenCV's tags stand on their heads.
            let index = 4 * id + [1, 0, 3, 2][turn];
            let found = ours.iter().find(|found| found.index == index).expect("the same tags").pixel;
            let [u, v] = [0, 1].map(|axis| corner[axis].as_f64().expect("a number"));
            let [x, y] = grid.corner_mm(index);
            let truth = place(&TargetKind::AprilGrid(grid)) * Point::<Target>::from_mm(Vector3::new(x, y, 0.0));
            let truth = lens().project_point(&truth).expect("in the field");
            apart.push(distance(found, Pixel { u, v }));
            ours_off.push(distance(found, truth));
            theirs_off.push(distance(Pixel { u, v }, truth));
        }
    }
    let worst = |off: &[f64]| off.iter().copied().fold(0.0, f64::max);
    let (apart, ours_off, theirs_off) = (worst(&apart), worst(&ours_off), worst(&theirs_off));
    println!("30 tags, apart {apart:.3} px at worst; from the truth {ours_off:.3} px, OpenCV {theirs_off:.3} px");
    assert!(apart < 0.5 && ours_off < 0.15, "{apart} px apart, {ours_off} px off");
}
