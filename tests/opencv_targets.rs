//! OpenCV as an independent reference for targets with tags: near the axis of a lens, where it works.
//!
//! The interpreter is `python3`, or that of `VERGENCE_PYTHON`. Without OpenCV's module (`python3 -m pip install
//! opencv-contrib-python-headless`) the tests print `SKIPPED`; with `VERGENCE_REQUIRE_DATA=1` they fail.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use common::python;
use common::{run_json, text};
use image::imageops::grayscale;
use image::{GrayImage, Luma};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_calibration_input::printed;
use vergence_scene::{Optics, Target};
use vergence_sim::photograph_target;
use vergence_targets::{AprilGridSpec, CharucoSpec, TagFamily, TargetKind, detect_april_grid, detect_charuco};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform, World};

/// What a script says.
fn output(python: &str, script: &str, arguments: &[&str]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/opencv_targets").join(script);
    let output = Command::new(python).arg(script).args(arguments).output().expect("python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    text(&output.stdout)
}

fn run(python: &str, script: &str, arguments: &[&str]) -> Value {
    serde_json::from_str(&output(python, script, arguments)).expect("JSON")
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
    let Some(python) = python("import cv2; cv2.aruco.ArucoDetector", "opencv-contrib-python-headless") else { return };
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

/// A ChArUco board, and how scripts and verbs call it.
struct Board {
    spec: CharucoSpec,
    script: [String; 6],
    verb: Vec<String>,
}

fn board(columns: u32, rows: u32, marker_mm: f64, dictionary: &str, legacy: bool) -> Board {
    let [square, marker] = [24.0, marker_mm].map(Length::from_mm);
    let family = TagFamily::dictionary(dictionary).expect("a dictionary");
    let number = |number: &dyn ToString| number.to_string();
    let script = [number(&columns), number(&rows), "24".into(), number(&marker_mm), dictionary.into()];
    let pattern = if legacy { "--legacy-pattern" } else { "" };
    let verb =
        format!("--charuco {columns}x{rows} --square 24mm --marker {marker_mm}mm --dictionary {dictionary} {pattern}");
    Board {
        spec: CharucoSpec { columns, rows, square, marker, dictionary: family, legacy },
        script: [&script[..], &[if legacy { "1" } else { "0" }.to_owned()]].concat().try_into().expect("six words"),
        verb: verb.split_whitespace().map(str::to_owned).collect(),
    }
}

/// Boards of all that may differ: size, margin, cells, number of markers, pattern.
fn boards() -> [Board; 4] {
    [
        board(9, 6, 17.5, "DICT_4X4_50", false),
        board(8, 6, 16.0, "DICT_5X5_100", true),
        board(7, 7, 18.0, "DICT_6X6_250", false),
        board(5, 6, 17.0, "DICT_4X4_1000", true),
    ]
}

impl Board {
    /// OpenCV's corners: those that it finds in the file, or those of the picture that it draws there.
    fn opencv(&self, python: &str, verb: &str, file: &Path) -> BTreeMap<u32, Pixel> {
        let file = file.to_string_lossy();
        let words: Vec<&str> = [verb, &file].into_iter().chain(self.script.iter().map(String::as_str)).collect();
        let corners = run(python, "charuco.py", &words);
        let read = |corner: &Value| {
            let [u, v] = [0, 1].map(|axis| corner["corner"][axis].as_f64().expect("a number"));
            (corner["id"].as_u64().expect("a number") as u32, Pixel { u, v })
        };
        corners.as_array().expect("corners").iter().map(read).collect()
    }

    /// Ours.
    fn found(&self, image: &GrayImage, hint: Option<&KannalaBrandt>) -> BTreeMap<u32, Pixel> {
        let found = detect_charuco(image, &self.spec, hint).expect("a board");
        found.iter().map(|corner| (corner.index, corner.pixel)).collect()
    }
}

/// The largest distance of corners of the same number; both have the same numbers.
fn apart(a: &BTreeMap<u32, Pixel>, b: &BTreeMap<u32, Pixel>) -> f64 {
    assert!(a.keys().eq(b.keys()), "{:?} and {:?}", a.keys(), b.keys());
    a.values().zip(b.values()).map(|(a, b)| (a.u - b.u).hypot(a.v - b.v)).fold(0.0, f64::max)
}

#[test]
fn every_dictionary_is_opencvs() {
    let Some(python) = python("import cv2; cv2.aruco.ArucoDetector", "opencv-contrib-python-headless") else { return };
    let names: Vec<&str> = TagFamily::dictionaries().iter().map(|dictionary| dictionary.name).collect();
    let theirs = output(&python, "dictionaries.py", &names);
    let theirs = theirs.lines().map(|code| u64::from_str_radix(code, 16).expect("a code"));
    assert!(theirs.eq(TagFamily::dictionaries().iter().flat_map(|dictionary| dictionary.codes.iter().copied())));
}

#[test]
fn boards_in_our_photographs_have_the_same_corners_for_opencv() {
    let Some(python) = python("import cv2; cv2.aruco.ArucoDetector", "opencv-contrib-python-headless") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    for board in boards() {
        let target = TargetKind::Charuco(board.spec);
        let image = photograph(&target);
        let file = folder.path().join("board.png");
        image.save(&file).expect("an image is written");
        let (theirs, ours) = (board.opencv(&python, "find", &file), board.found(&image, Some(&lens())));
        let truth = (0..board.spec.corners()).map(|index| {
            let [x, y] = board.spec.corner_mm(index);
            let at = place(&target) * Point::<Target>::from_mm(Vector3::new(x, y, 0.0));
            (index, lens().project_point(&at).expect("in the field"))
        });
        let truth: BTreeMap<u32, Pixel> = truth.collect();
        let (apart, off, theirs_off) =
            (self::apart(&ours, &theirs), self::apart(&ours, &truth), self::apart(&theirs, &truth));
        println!("{target}: apart {apart:.3} px at worst; from the truth {off:.3} px, OpenCV {theirs_off:.3} px");
        assert!(apart < 0.5 && off < 0.2, "{apart} px apart, {off} px off");
    }
}

#[test]
fn boards_that_opencv_draws_are_found_with_its_numbers() {
    let Some(python) = python("import cv2; cv2.aruco.ArucoDetector", "opencv-contrib-python-headless") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    for board in boards() {
        let file = folder.path().join("board.png");
        let drawn = board.opencv(&python, "draw", &file);
        let image = image::open(&file).expect("an image").to_luma8();
        let apart = apart(&board.found(&image, None), &drawn);
        println!("{}: {} corners, {apart:.3} px off at worst", TargetKind::Charuco(board.spec), drawn.len());
        assert!(apart < 0.2, "{apart} px");
    }
}

/// The file that is printed, at 6 pixels a millimetre.
#[test]
fn sheets_that_we_draw_are_boards_for_opencv() {
    const PX_PER_MM: f64 = 6.0;
    let Some(python) = python("import cv2; cv2.aruco.ArucoDetector", "opencv-contrib-python-headless") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let (svg, png) = (folder.path().join("board.svg"), folder.path().join("board.png"));
    for board in boards() {
        let file = svg.to_string_lossy();
        let words = ["target", "--json", "--out", &file].into_iter().chain(board.verb.iter().map(String::as_str));
        run_json(&words.collect::<Vec<_>>());
        let drawing = std::fs::read_to_string(&svg).expect("a drawing");
        let mut image = GrayImage::from_pixel(1782, 1260, Luma([255]));
        let black =
            drawing.split("<g fill=\"black\"").nth(1).and_then(|rest| rest.split("</g>").next()).expect("black");
        for rectangle in black.lines().filter(|line| line.starts_with("<rect")) {
            let numbers: Vec<f64> = rectangle.split('"').filter_map(|word| word.parse().ok()).collect();
            let [x, y, width, height] = numbers.try_into().expect("a rectangle");
            let pixels = |start: f64, length: f64| {
                (start * PX_PER_MM).round() as u32..((start + length) * PX_PER_MM).round() as u32
            };
            for row in pixels(y, height) {
                pixels(x, width).for_each(|column| image.put_pixel(column, row, Luma([0])));
            }
        }
        image.save(&png).expect("an image is written");
        let theirs = board.opencv(&python, "find", &png);
        let middle = |paper: f64, squares: u32| 0.5 * paper - 24.0 * (0.5 * f64::from(squares) - 1.0);
        let (left, top) = (middle(297.0, board.spec.columns), middle(210.0, board.spec.rows));
        let place = |index: u32| {
            let [x, y] = board.spec.corner_mm(index);
            let [u, v] = [left + x, top + y].map(|mm| mm * PX_PER_MM - 0.5);
            (index, Pixel { u, v })
        };
        let apart = apart(&theirs, &(0..board.spec.corners()).map(place).collect());
        println!("{}: {} corners for OpenCV, {apart:.3} px off at worst", board.verb.join(" "), theirs.len());
        assert!(apart < 1.0, "{apart} px");
    }
}
