//! Camera files of other programs.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use nalgebra::{UnitQuaternion, Vector3};
use vergence_rig::{Camchain, CameraFormat, CameraTable, InterchangeError, kalibr, opencv};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, OpenCvFisheye, Transform, UnitRay};

const LENS: OpenCvFisheye =
    OpenCvFisheye { fx: 227.64, fy: 226.81, cx: 471.41, cy: 305.55, k: [0.0265, -0.0294, 0.0269, -0.0096] };
const SIZE: ImageSize = ImageSize { width: 960, height: 600 };

fn camera() -> KannalaBrandt {
    KannalaBrandt::from_opencv(LENS, Angle::from_deg(85.0), SIZE).expect("a lens")
}

/// Written by OpenCV 5.0.0: `fs = cv2.FileStorage(name, cv2.FILE_STORAGE_WRITE)`, then `fs.write` of two integers and
/// two arrays.
const BY_OPENCV: &str = "%YAML 1.2
---
image_width: 960
image_height: 600
K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 227.63999999999999, 0., 471.41000000000003, 0., 226.81,
       305.55000000000001, 0., 0., 1. ]
D: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 0.026499999999999999, -0.029399999999999999, 0.0269,
       -0.0095999999999999992 ]
";

#[test]
fn opencv_files_are_read() {
    assert_eq!(CameraFormat::of(BY_OPENCV), CameraFormat::OpenCv);
    let camera = opencv::read(BY_OPENCV).expect("OpenCV wrote it");
    let lens = camera.to_opencv();
    assert!((lens.fx - LENS.fx).abs() < 1e-12 && (lens.cy - LENS.cy).abs() < 1e-12);
    assert!(lens.k.iter().zip(LENS.k).all(|(got, expected)| (got - expected).abs() < 1e-12));
    assert_eq!(camera.size(), SIZE);
    // No field stated: as far as the image and the polynomial reach.
    assert_eq!(camera.theta_max(), LENS.largest_theta(SIZE).expect("a lens"));
}

#[test]
fn every_format_gives_back_the_same_camera() {
    let camera = camera();
    let toml = toml::to_string(&CameraTable::of(&camera)).expect("TOML");
    let table: CameraTable = toml::from_str(&toml).expect("what we wrote");
    let chain = kalibr::write(&Camchain { left: camera, right: None });
    assert_eq!(CameraFormat::of(&chain), CameraFormat::Kalibr);
    assert_eq!(CameraFormat::of(&opencv::write(&camera)), CameraFormat::OpenCv);
    for back in [
        table.camera().expect("a lens"),
        opencv::read(&opencv::write(&camera)).expect("what we wrote"),
        kalibr::read(&chain).expect("what we wrote").left,
    ] {
        assert!((back.theta_max().deg() - 85.0).abs() < 1e-9);
        let ray = UnitRay::<vergence_vision::Camera>::new(Vector3::new(1.0, -0.7, 0.2)).expect("a direction");
        let (got, expected) = (back.project(&ray).expect("in the field"), camera.project(&ray).expect("in the field"));
        assert!((got.u - expected.u).hypot(got.v - expected.v) < 1e-9);
    }
}

#[test]
fn a_pair_keeps_its_pose() {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 2.0, -0.05));
    let left_from_right = Transform::new(rotation, Vector3::new(140.0, 3.0, -12.0));
    let text = kalibr::write(&Camchain { left: camera(), right: Some((camera(), left_from_right)) });
    let (_, back) = kalibr::read(&text).expect("what we wrote").right.expect("a pair");
    assert!((back.origin().mm() - left_from_right.origin().mm()).norm() < 1e-9);
    assert!(back.rotation().angle_to(&rotation) < 1e-9);
    // In metres, the left camera seen from the right one.
    let expected = left_from_right.inverse().origin().mm().x / 1000.0;
    assert!(text.contains(&format!("{expected:?}")), "{text}");
}

#[test]
fn unreadable_camera_files_are_refused() {
    let radtan = kalibr::write(&Camchain { left: camera(), right: None }).replace("equidistant", "radtan");
    assert!(matches!(kalibr::read(&radtan), Err(InterchangeError::Model(_))));
    assert!(matches!(opencv::read("%YAML:1.0\n---\nK: 3\n"), Err(InterchangeError::Syntax(_))));
    assert!(matches!(opencv::read("%YAML:1.0\n---\nimage_width: 9\n"), Err(InterchangeError::Missing(_))));
    let five = BY_OPENCV.replace("[ 0.026499999999999999,", "[ 0.1, 0.026499999999999999,");
    assert!(matches!(opencv::read(&five), Err(InterchangeError::Model(_))));
    let not_rigid = kalibr::write(&Camchain {
        left: camera(),
        right: Some((camera(), Transform::new(UnitQuaternion::identity(), Vector3::x()))),
    })
    .replace("[1.0, 0.0, 0.0, ", "[2.0, 0.0, 0.0, ");
    assert!(matches!(kalibr::read(&not_rigid), Err(InterchangeError::Missing(_))), "{not_rigid}");
}
