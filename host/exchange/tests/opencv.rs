//! OpenCV's own files and projections as an independent reference.
//!
//! The interpreter is `python3`, or that of `VERGENCE_PYTHON`. Without OpenCV's contributed modules (`python3 -m pip install
//! opencv-contrib-python-headless`) the test prints `SKIPPED`; with `VERGENCE_REQUIRE_DATA=1` it fails.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "../../../tests/common/data.rs"]
mod data;
#[path = "../../../tests/common/python.rs"]
mod python;

use std::path::Path;
use std::process::Command;

use nalgebra::Vector3;
use serde_json::Value;
use vergence_exchange::Format;
use vergence_vision::{Point, Right, UnitRay};

/// What the script says after it has written its files to `folder`; `None` without OpenCV.
fn said(folder: &Path) -> Option<Value> {
    let python = python::python("import cv2; cv2.omnidir.projectPoints", "opencv-contrib-python-headless")?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/opencv.py");
    let output = Command::new(python).arg(script).arg(folder).output().expect("python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).expect("JSON"))
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().expect("a number"))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

#[test]
fn every_model_projects_as_opencv_does_from_the_file_that_opencv_wrote() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(said) = said(folder.path()) else { return };
    assert_eq!(list(&said["cameras"]).len(), 8);
    for camera in list(&said["cameras"]) {
        let (name, file) = (&camera["name"], camera["file"].as_str().expect("a path"));
        let text = std::fs::read_to_string(file).expect("OpenCV wrote it");
        let rig = vergence_exchange::read(&text).unwrap_or_else(|error| panic!("{name}: {error}\n{text}"));
        assert_eq!(rig.format, Format::OpenCv);
        let model = &rig.cameras[0].model;
        let mut worst = 0.0_f64;
        for (direction, pixel) in list(&camera["rays"]).iter().zip(list(&camera["pixels"])) {
            let ray = UnitRay::new(vector(direction)).expect("a direction");
            let ours = model.project(&ray).unwrap_or_else(|_| panic!("{name}: {direction} is seen"));
            let [u, v] = [0, 1].map(|axis| pixel[axis].as_f64().expect("a number"));
            worst = worst.max((ours.u - u).hypot(ours.v - v));
        }
        println!("{name}, {}: {worst:.1e} px from OpenCV at most", model.name());
        assert!(worst < 1e-9, "{name}: {worst} px");
    }
    let text = std::fs::read_to_string(said["pair"].as_str().expect("a path")).expect("OpenCV wrote it");
    let rig = vergence_exchange::read(&text).expect("a pair");
    let pair = rig.pair(None).expect("two cameras");
    let in_left = pair.left_from_right * Point::<Right>::from_mm(vector(&said["right"]));
    assert!((in_left.mm() - vector(&said["left"])).norm() < 1e-9, "{:?}", in_left.mm());
}
