//! Cameras and rigs of other programs on the command line.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::fmt::Write as _;
use std::process::Command;

use common::built_bench::Dice;
use common::pairs::Work;
use common::{fails_with, python, run, run_json, text};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};
use vergence_exchange::{Cameras, WriteFormat};
use vergence_rig::{BENCH_TOML, Rig};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Left, OpenCvFisheye, Point, Right, Transform, UnitRay};

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

fn written(folder: &tempfile::TempDir, name: &str, text: &str) -> String {
    let path = path(folder, name);
    std::fs::write(&path, text).expect("written");
    path
}

fn read_rig(path: &str) -> Rig {
    Rig::from_toml(&std::fs::read_to_string(path).expect("a rig file")).expect("a rig")
}

fn lens(focal: f64, cx: f64) -> KannalaBrandt {
    let lens = OpenCvFisheye { fx: focal, fy: 1.002 * focal, cx, cy: 305.0, k: [0.02, -0.01, 0.004, -0.001] };
    let size = ImageSize { width: 960, height: 600 };
    KannalaBrandt::from_opencv(lens, Angle::from_deg(92.0), size).expect("a lens")
}

/// A pair whose cameras are as different as those of a real pair never are.
fn pair() -> (KannalaBrandt, KannalaBrandt, Transform<Left, Right>) {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, 0.3, -0.01));
    (lens(230.0, 470.0), lens(300.0, 490.0), Transform::new(turn, Vector3::new(140.0, 3.0, -12.0)))
}

/// A camchain of [`pair`], as Kalibr writes it but for the digits.
fn camchain() -> String {
    let (left, right, pose) = pair();
    let written = vergence_exchange::write(WriteFormat::Kalibr, &Cameras { left, right: Some((right, pose)) });
    written.expect("Kalibr holds them").files[0].text.clone()
}

/// Corners of 8 targets that both cameras of [`pair`] see.
fn corners() -> String {
    let (left, right, left_from_right) = pair();
    let mut dice = Dice::new(7);
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    for frame in 0..8 {
        let tilt = UnitQuaternion::from_euler_angles(0.5 * dice.uniform(), 0.5 * dice.uniform(), 3.0 * dice.uniform());
        let middle = Vector3::new(70.0, 0.0, 350.0) + 90.0 * dice.vector();
        for index in 0..54_u32 {
            let [x, y] = [index % 9, index / 9].map(|n| 20.0 * f64::from(n));
            let at = Point::<Left>::from_mm(middle + tilt * Vector3::new(x - 80.0, y - 50.0, 0.0));
            let seen = [
                ("left", left.project_point(&at).expect("in the left field")),
                ("right", right.project_point(&(left_from_right.inverse() * at)).expect("in the right field")),
            ];
            for (camera, pixel) in seen {
                let (u, v) = (pixel.u + 0.1 * dice.normal(), pixel.v + 0.1 * dice.normal());
                writeln!(text, "{camera},f{frame}.png,{frame},{index},{u},{v},{x},{y}").expect("text");
            }
        }
    }
    text
}

/// Before, `--right` took the first camera of a camchain too, and the calibration went wrong without a word.
#[test]
fn regression_the_right_camera_of_a_camchain_is_its_second() {
    let folder = temporary();
    let (chain, csv) = (written(&folder, "chain.yaml", &camchain()), written(&folder, "corners.csv", &corners()));
    let calibrated = |left: &str, right: &str| {
        run(&["calibrate", "extrinsics", "--json", "--csv", &csv, "--left", left, "--right", right])
    };
    let baseline = |output: &std::process::Output| {
        let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        json["joint"]["baseline_mm"].as_f64().unwrap_or_else(|| panic!("{json}"))
    };
    let truth = pair().2.origin().mm().norm();
    let second = format!("{chain}#cam1");
    for (left, right) in [(chain.as_str(), chain.as_str()), (chain.as_str(), second.as_str())] {
        let output = calibrated(left, right);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!((baseline(&output) - truth).abs() < 0.5, "{} mm, not {truth}", baseline(&output));
    }
    assert!(text(&calibrated(&chain, &chain).stderr).contains("cam1 is taken as the right camera"));
    // The first camera on both sides fits nothing.
    let wrong = calibrated(&chain, &format!("{chain}#cam0"));
    assert!(!wrong.status.success() || (baseline(&wrong) - truth).abs() > 5.0, "{}", text(&wrong.stdout));
    fails_with(&["camera", "project", &chain, "0,0,1"], 2, &["2 cameras", "FILE#cam0 or FILE#cam1"]);
    fails_with(&["camera", "project", &format!("{chain}#cam7"), "0,0,1"], 2, &["no camera 'cam7'", "cam0, cam1"]);
}

const FOUR: &str = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n\
    camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]\n\
    distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 4\n   dt: d\n   data: [ -0.28, 0.07, 2e-4, 2e-5 ]\n";

/// Before, such a file of a pinhole camera was read as one of a fisheye.
#[test]
fn regression_four_coefficients_without_a_model_are_not_taken_for_a_fisheye() {
    let folder = temporary();
    let file = written(&folder, "four.yaml", FOUR);
    fails_with(&["camera", "show", &file], 2, &["OpenCV", "model: fisheye", "model: pinhole"]);
    let shown = |model: &str| {
        let file = written(&folder, "stated.yaml", &FOUR.replace("---\n", &format!("---\nmodel: {model}\n")));
        run_json(&["camera", "project", "--json", &file, "0.4,0.1,1"])["pixels"][0][0].as_f64().expect("a pixel")
    };
    // x = 0.4, r² = 0.17: 500 (0.4 (1 - 0.28 r² + 0.07 r⁴) + 2 p1 x y + p2 (r² + 2 x²)) + 320.
    let pinhole = 500.0 * (0.4 * (1.0 - 0.28 * 0.17 + 0.07 * 0.17 * 0.17) + 2e-4 * 0.08 + 2e-5 * (0.17 + 0.32)) + 320.0;
    assert!((shown("pinhole") - pinhole).abs() < 1e-9, "{} instead of {pinhole}", shown("pinhole"));
    assert!((shown("fisheye") - pinhole).abs() > 5.0, "{}", shown("fisheye"));
}

#[test]
fn how_far_a_lens_is_off_is_always_said() {
    let folder = temporary();
    let file = written(&folder, "stated.yaml", &FOUR.replace("---\n", "---\nmodel: pinhole\n"));
    let out = path(&folder, "camera.toml");
    for arguments in [
        vec!["camera", "project", "--json", &file, "0,0,1"],
        vec!["camera", "convert", &file, "--to", "toml", "--out", &out],
        vec!["calibrate", "diff", "--json", &file, &file],
    ] {
        let output = run(&arguments);
        assert!(output.status.success() && text(&output.stderr).contains("px rms off it"), "{arguments:?}");
    }
    let shown = run_json(&["camera", "show", "--json", &file]);
    assert!(shown["cameras"][0]["remark"].as_str().expect("a remark").contains("pinhole model"), "{shown}");
    assert!(std::fs::read_to_string(&out).expect("a camera file").starts_with("# camera has the pinhole model"));
    run_json(&["camera", "show", "--json", &out]);
}

/// Four double sphere cameras that look into four directions, at different heights.
fn four_cameras() -> Value {
    let turn = |quarter: usize| UnitQuaternion::from_scaled_axis(Vector3::y() * (quarter as f64 * 1.5));
    let pose = |quarter: usize| {
        let (q, at) = (turn(quarter), turn(quarter) * Vector3::new(0.0, 0.02 * quarter as f64, 0.05));
        json!({"px": at.x, "py": at.y, "pz": at.z, "qx": q.i, "qy": q.j, "qz": q.k, "qw": q.w})
    };
    let values = json!({"fx": 158.2, "fy": 158.3, "cx": 255.0, "cy": 256.9, "xi": -0.172, "alpha": 0.593});
    json!({"value0": {
        "T_imu_cam": (0..4).map(pose).collect::<Vec<_>>(),
        "intrinsics": vec![json!({"camera_type": "ds", "intrinsics": values}); 4],
        "resolution": vec![[512, 512]; 4],
    }})
}

/// Before, a polynomial was computed with in the place of the file's model, here up to a tenth of a pixel off it.
#[test]
fn regression_a_camera_of_another_program_is_computed_by_its_own_model() {
    let folder = temporary();
    let file = written(&folder, "calibration.json", &four_cameras().to_string());
    let (camera, rig) = (path(&folder, "camera.toml"), path(&folder, "rig.toml"));
    run_json(&["camera", "convert", "--json", &format!("{file}#cam1"), "--to", "toml", "--out", &camera]);
    run_json(&["rig", "import", "--json", &file, "--cameras", "cam0,cam1", "--out", &rig]);
    let (right, again) = (read_rig(&rig).right_camera, path(&folder, "again.toml"));
    for [x, y, z] in [[0.3, -0.2, 0.9], [-0.7, 0.4, 0.1], [0.6, 0.5, -0.2]] {
        // V. Usenko, N. Demmel and D. Cremers, 3DV 2018, eq. 40 to 42.
        let (xi, alpha) = (-0.172, 0.593);
        let d1 = Vector3::new(x, y, z).norm();
        let d2 = Vector3::new(x, y, xi * d1 + z).norm();
        let depth: f64 = alpha * d2 + (1.0 - alpha) * (xi * d1 + z);
        let truth = [158.2 * x / depth + 255.0, 158.3 * y / depth + 256.9];
        let near = |[u, v]: [f64; 2], what: &str| {
            assert!((u - truth[0]).hypot(v - truth[1]) < 1e-9, "{what}: {u}, {v} instead of {truth:?}");
        };
        for file in [format!("{file}#cam1"), camera.clone()] {
            let seen = run_json(&["camera", "project", "--json", &file, &format!("{x},{y},{z}")]);
            let number = |index: usize| seen["pixels"][0][index].as_f64().unwrap_or_else(|| panic!("{seen}"));
            near([0, 1].map(number), &file);
        }
        let ray = UnitRay::<Camera>::new(Vector3::new(x, y, z)).expect("a direction");
        let pixel = right.project(&ray).expect("in the field");
        near([pixel.u, pixel.v], "the rig file");
        let back = right.unproject::<Camera>(pixel).expect("in the field");
        assert!((back.vector() - ray.vector()).norm() < 1e-9, "{back:?}");
    }
    // What is read of our own file is written again without a change.
    run_json(&["camera", "convert", "--json", &camera, "--to", "toml", "--out", &again]);
    let [first, second] = [&camera, &again].map(|path| std::fs::read_to_string(path).expect("a camera file"));
    let table = |text: &str| text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n");
    assert_eq!(table(&first), table(&second));
}

#[test]
fn a_rig_of_four_cameras_becomes_four_pairs_in_one_command_each() {
    let folder = temporary();
    let file = written(&folder, "calibration.json", &four_cameras().to_string());
    let out = path(&folder, "rig.toml");
    for (left, right) in [(0, 1), (1, 2), (2, 3), (3, 0)] {
        let names = format!("cam{left},{right}");
        let said = run(&["rig", "import", &file, "--cameras", &names, "--out", &out]);
        assert!(said.status.success(), "{}", text(&said.stderr));
        assert!(text(&said.stderr).contains("double sphere model"), "{}", text(&said.stderr));
        let pose = read_rig(&out).pose_at_values(&[]).left_from_right;
        let quarter = if right == 0 { -3.0 } else { 1.0 };
        let expected = UnitQuaternion::from_scaled_axis(Vector3::y() * (quarter * 1.5));
        assert!(pose.rotation().angle_to(&expected) < 1e-9, "{names}");
        let heights = 20.0 * (f64::from(right) - f64::from(left));
        assert!((pose.origin().mm().y - heights).abs() < 1e-9, "{names}: {}", pose.origin().mm());
    }
    fails_with(&["rig", "import", &file, "--out", &out], 2, &["a pair has two cameras", "cam0, cam1, cam2, cam3"]);
    fails_with(&["zones", "--rig", &file, "--mode", "any"], 2, &["a pair has two cameras"]);
    // The same two without a rig file of their own.
    fails_with(&["zones", "--rig", &format!("{file}#0,2"), "--mode", "any"], 2, &["(cam0, cam2)", "no mode"]);
}

#[test]
fn a_rig_goes_out_and_comes_back() {
    let folder = temporary();
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
    let truth = bench.pose_at_values(&[145.0, 120_f64.to_radians()]).left_from_right;
    let ray = UnitRay::<Camera>::new(Vector3::new(0.5, -0.4, 0.1)).expect("a direction");
    let expected = bench.right_camera.project(&ray).expect("in the field");
    let exact = ["opencv", "kalibr", "basalt", "ros", "tum-vi"].map(|format| (format, 1e-9));
    for (format, limit_px) in exact.into_iter().chain([("mrcal", 0.02)]) {
        let (file, out) = (path(&folder, &format!("{format}.txt")), path(&folder, &format!("{format}.toml")));
        let sent = run_json(&["rig", "export", "--json", "--mode", "herbivore", "--to", format, "--out", &file]);
        let files: Vec<&str> = sent["out"].as_array().expect("files").iter().filter_map(Value::as_str).collect();
        assert_eq!(
            files.len(),
            if matches!(format, "ros" | "mrcal" | "tum-vi") { 2 } else { 1 },
            "{format}: {files:?}"
        );
        run_json(&[&["rig", "import", "--json", "--out", &out][..], &files].concat());
        let back = read_rig(&out);
        let pose = back.pose_at_values(&[]).left_from_right;
        let off = (pose.origin().mm() - truth.origin().mm()).norm();
        assert!(off < 1e-6 && pose.rotation().angle_to(&truth.rotation()) < 1e-9, "{format}: {off} mm");
        let pixel = back.right_camera.project(&ray).expect("in the field");
        let off = (pixel.u - expected.u).hypot(pixel.v - expected.v);
        println!("{format}: {off:.1e} px");
        assert!(off < limit_px, "{format}: {off} px");
    }
    let file = path(&folder, "cameras.txt");
    let sent = run_json(&["rig", "export", "--json", "--mode", "herbivore", "--to", "colmap", "--out", &file]);
    assert!(sent["remarks"][0].as_str().expect("a remark").contains("no unit"), "{sent}");
    fails_with(&["rig", "import", &file, "--out", &file], 2, &["does not say where camera"]);
    let pixel = run_json(&["camera", "project", "--json", &format!("{file}#2"), "0.5,-0.4,0.1"]);
    assert!((pixel["pixels"][0][0].as_f64().expect("a pixel") - expected.u).abs() < 1e-6, "{pixel}");
    fails_with(&["rig", "export", "--to", "kalibr", "--out", &file], 2, &["cameras of this rig move", "--mode"]);
}

#[test]
fn colmap_reads_the_pair_and_its_pose() {
    const READ: &str = r#"
import json, sys
import numpy, pycolmap
model = pycolmap.Reconstruction(sys.argv[1])
place = numpy.array(json.loads(sys.argv[2]))
pixels = {image.name: image.camera.img_from_cam(image.cam_from_world() * place).tolist() for image in model.images.values()}
print(json.dumps({"pixels": pixels, "points": len(model.points3D)}))
"#;
    let folder = temporary();
    let file = path(&folder, "cameras.txt");
    let export = ["rig", "export", "--json", "--mode", "herbivore", "--to", "colmap", "--out", &file];
    let sent = run_json(&export);
    assert_eq!(sent["out"].as_array().map(Vec::len), Some(3), "{sent}");
    fails_with(&export, 2, &["images.txt", "is there already"]);
    let images = std::fs::read_to_string(path(&folder, "images.txt")).expect("the poses");
    let lines: Vec<&str> = images.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(lines.len(), 4, "{images}");
    assert_eq!((lines[0], lines[1], lines[3]), ("1 1.0 0.0 0.0 0.0 0.0 0.0 0.0 1 left.png", "", ""));

    let Some(python) = python("import pycolmap", "pycolmap") else { return };
    // A place between the axes of the cameras, which are turned by 120 degrees.
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
    let left_from_right = bench.pose_at_values(&[145.0, 120_f64.to_radians()]).left_from_right;
    let between = left_from_right.rotation().powf(0.5) * Vector3::new(-60.0, 80.0, 900.0);
    let in_left = Point::<Left>::from_mm(left_from_right.origin().mm() / 2.0 + between);
    let in_right = left_from_right.inverse() * in_left;
    let pixel = |lens: &KannalaBrandt, ray: Option<UnitRay<Camera>>| lens.project(&ray.expect("a direction"));
    let place = json!((in_left.mm() / 1000.0).as_slice()).to_string();
    let output = Command::new(python).args(["-c", READ]).arg(folder.path()).arg(place).output().expect("python runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let seen: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("{seen}");
    for (name, lens, at) in
        [("left.png", &bench.left_camera, in_left.mm()), ("right.png", &bench.right_camera, in_right.mm())]
    {
        let expected = pixel(lens, UnitRay::new(at)).expect("in the field");
        let [u, v] = [0, 1].map(|axis| seen["pixels"][name][axis].as_f64().expect("a pixel") - 0.5);
        assert!((u - expected.u).hypot(v - expected.v) < 1e-6, "{name}: {u} {v} is not {expected:?}");
    }
}

#[test]
fn files_that_are_none_are_named_and_never_taken_for_toml() {
    let folder = temporary();
    let vins = "%YAML:1.0\n---\nmodel_type: MEI\ncamera_name: camera\nimage_width: 752\nimage_height: 480\n";
    let info = "image_width: 640\nimage_height: 480\ncamera_name: left\ndistortion_model: thin_plate\n\
        camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n\
        distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0, 0, 0, 0]\n";
    let cases: [(&str, &[&str]); 5] = [
        (vins, &["camodocal", "not read"]),
        (info, &["this is a ROS camera_info", "thin_plate"]),
        ("<?xml version=\"1.0\"?>\n<opencv_storage>\n</opencv_storage>\n", &["OpenCV's FileStorage as XML", "YAML"]),
        ("some words\n", &["no camera file of a known format"]),
        ("cam0:\n  camera_model: pinhole\n", &["this is a Kalibr camchain", "cam0", "resolution"]),
    ];
    for (text, words) in cases {
        let file = written(&folder, "file.any", text);
        for arguments in [
            vec!["camera", "show", &file],
            vec!["zones", "--rig", &file, "--mode", "any"],
            vec!["rig", "import", &file, "--out", "/nowhere/rig.toml"],
        ] {
            fails_with(&arguments, 2, &[words, &["file.any"][..]].concat());
            let said = common::text(&run(&arguments).stderr);
            assert!(!said.contains("TOML"), "{said}");
        }
    }
    // What is meant as this program's own is told as such.
    let own = written(&folder, "own.toml", "name = \"rig\"\n[left.camera]\nfx = 3\n");
    fails_with(&["zones", "--rig", &own, "--mode", "any"], 2, &["own.toml", "TOML"]);
}

#[test]
fn depth_measures_with_another_programs_rig_as_with_its_own() {
    let work = Work::new();
    work.photograph(0.0, 3, ["left.png", "right.png"]);
    let (own, chain) = (work.file("rig.toml"), work.file("chain.yaml"));
    run_json(&["rig", "export", "--json", "--rig", &own, "--mode", "human", "--to", "kalibr", "--out", &chain]);
    let (left, right) = (work.file("left.png"), work.file("right.png"));
    let points = |rig: &str, more: &[&str]| {
        let out = work.file("out.ply");
        let depth = ["depth", "--json", "--rig", rig, "--left", &left, "--right", &right, "--out", &out];
        run_json(&[&depth[..], more].concat())["points"].as_u64().expect("a number of points")
    };
    let (ours, theirs) = (points(&own, &["--mode", "human"]), points(&chain, &[]));
    println!("{ours} points by our rig file, {theirs} by the camchain");
    assert!(ours > 200 && theirs.abs_diff(ours) * 20 < ours, "{ours} and {theirs} points");
}
