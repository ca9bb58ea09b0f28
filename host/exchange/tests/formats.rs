//! Files of every format that is read: parameters in their places, poses the right way round, and what is refused.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod samples;

use nalgebra::Vector3;
use samples::*;
use vergence_exchange::{
    Cameras, ExchangeError, ForeignCamera, ForeignPair, ForeignRig, Format, Recognised, WriteFormat, write,
};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, OpenCvFisheye, Pixel, UnitRay};

const AHEAD: [f64; 3] = [0.3, -0.2, 0.9];
const BEHIND: [f64; 3] = [-0.7, 0.4, -0.1];

fn read(format: Format, text: &str) -> ForeignRig {
    assert_eq!(Recognised::of(text), Recognised::Foreign(format), "{text}");
    let rig = vergence_exchange::read(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(rig.format, format);
    rig
}

fn refused(text: &str, words: &[&str]) {
    let said = vergence_exchange::read(text).expect_err("it must be refused").to_string();
    for word in words {
        assert!(said.contains(word), "'{said}' should say '{word}'");
    }
}

fn pixel(camera: &ForeignCamera, ray: [f64; 3]) -> Pixel {
    let ray = UnitRay::<Camera>::new(Vector3::from(ray)).expect("a direction");
    camera.model.project(&ray).unwrap_or_else(|_| panic!("{} sees {ray:?}", camera.name))
}

fn shows(camera: &ForeignCamera, ray: [f64; 3], [u, v]: [f64; 2]) {
    let got = pixel(camera, ray);
    assert!((got.u - u).hypot(got.v - v) < 1e-6, "{}: {got:?}, not {u}, {v}", camera.name);
}

fn near(got: Vector3<f64>, expected: [f64; 3]) {
    assert!((got - Vector3::from(expected)).norm() < 1e-6, "{got}, not {expected:?}");
}

/// OpenCV's fisheye with the coefficients of the samples, past 90° too.
fn equidistant(size: ImageSize, centre: [f64; 2]) -> KannalaBrandt {
    let lens = OpenCvFisheye { fx: 600.0, fy: 601.0, cx: centre[0], cy: centre[1], k: EQUIDISTANT };
    KannalaBrandt::from_opencv(lens, lens.largest_theta(size).expect("a field"), size).expect("a lens")
}

fn is_equidistant(camera: &ForeignCamera, centre: [f64; 2]) {
    let lens = camera.model.as_kannala_brandt().expect("this program's own model");
    assert_eq!(lens, equidistant(camera.size, centre), "{}", camera.name);
    let fit = camera.lens().expect("a lens");
    assert_eq!((fit.lens, fit.largest_px, camera.remark(&fit)), (lens, 0.0, None));
}

#[test]
fn kalibr_models_have_their_parameters_in_order() {
    // The pixels of lens-models.md §7 and of mrcal's OPENCV4.
    let cases = [
        ("ds", "none", "[-0.2, 0.6, 600, 601, 1024, 1022]", "[]", AHEAD, [1_261.426_159_289, 863.452_086_964]),
        ("eucm", "none", "[0.65, 1.1, 600, 601, 1024, 1022]", "[]", BEHIND, [213.900_851_740, 1_485.685_322_004]),
        ("omni", "radtan", "[1.5, 1500, 1501, 1024, 1022]", FOUR, BEHIND, [105.530_642_710, 1_547.746_470_314]),
        ("pinhole", "radtan", "[600, 601, 1024, 1022]", FOUR, AHEAD, [1_222.242_874_562, 889.682_118_292]),
        ("pinhole", "none", "[600, 601, 1024, 1022]", "[]", AHEAD, [1_224.0, 888.444_444_444]),
    ];
    for (model, distortion, intrinsics, coefficients, ray, pixel) in cases {
        let text = kalibr_camera("cam0", model, distortion, intrinsics, coefficients);
        shows(&read(Format::Kalibr, &text).cameras[0], ray, pixel);
    }
    let text = kalibr_camera("cam0", "pinhole", "equidistant", "[600, 601, 1024, 1022]", EQUI);
    is_equidistant(&read(Format::Kalibr, &text).cameras[0], [1024.0, 1022.0]);
    // Files written by this program say up to which angle the polynomial is good.
    let limited = read(Format::Kalibr, &(text.clone() + "  theta_max_deg: 80\n"));
    assert_eq!(limited.cameras[0].model.half_field(), Angle::from_deg(80.0));
    for (model, distortion) in [("pinhole", "fov"), ("omni", "equidistant"), ("ds", "radtan"), ("best", "none")] {
        let text = kalibr_camera("cam0", model, distortion, "[1, 2, 3, 4]", FOUR);
        refused(&text, &["Kalibr", &format!("{model}-{distortion}"), "not read"]);
    }
    refused(&text.replace("[600,", "[-600,"), &["cam0 is no camera", "focal"]);
    refused(&text.replace("resolution: [2048, 2044]", "resolution: [2048.5, 0]"), &["no size"]);
    refused(&text.replace("0.003", "much"), &["distortion_coeffs.1", "no finite number"]);
}

#[test]
fn a_chain_of_kalibr_is_followed_to_its_end() {
    let rig = read(Format::Kalibr, &kalibr_chain());
    assert_eq!(rig.names(), ["cam0", "cam1", "cam2"]);
    // Each camera stands 100 mm to the right of the one before and is turned by 90° about y against it.
    let pair = rig.pair(Some(["cam0", "cam1"])).expect("a pair");
    near(pair.left_from_right.origin().mm(), [100.0, 0.0, 0.0]);
    near(pair.left_from_right.rotation() * Vector3::z(), [1.0, 0.0, 0.0]);
    let pair = rig.pair(Some(["0", "2"])).expect("a pair");
    near(pair.left_from_right.origin().mm(), [100.0, 0.0, -100.0]);
    near(pair.left_from_right.rotation() * Vector3::z(), [0.0, 0.0, -1.0]);
    assert!(matches!(rig.pair(None), Err(ExchangeError::NotTwo { .. })));
    assert!(matches!(rig.pair(Some(["cam0", "cam0"])), Err(ExchangeError::NotTwo { .. })));
    assert!(matches!(rig.camera(Some("cam3")), Err(ExchangeError::NoCamera { .. })));
    assert!(matches!(rig.camera(None), Err(ExchangeError::Several { .. })));
    // Without the chain, by the IMU; without both, not at all.
    let text = kalibr_chain();
    let by_imu = text.replace("T_cn_cnm1", "T_cam_imu").replacen("[1.0, 0.0, 0.0, -0.1]", "[1.0, 0.0, 0.0, -0.2]", 1);
    let rig = read(Format::Kalibr, &by_imu);
    assert!(matches!(rig.pair(Some(["0", "1"])), Err(ExchangeError::NoPose { .. })));
    let pair = rig.pair(Some(["1", "2"])).expect("both have a pose by the IMU");
    near(pair.left_from_right.origin().mm(), [0.0, 0.0, -100.0]);
    near(pair.left_from_right.rotation() * Vector3::z(), [0.0, 0.0, 1.0]);
    refused(&text.replace("cam1:", "cam7:"), &["cam2", "before it"]);
    refused(&text.replacen("[0.0, 1.0, 0.0, 0.0]", "[0.0, 2.0, 0.0, 0.0]", 1), &["cam1.T_cn_cnm1", "rigid"]);
}

#[test]
fn basalt_models_and_poses() {
    let rig = read(Format::Basalt, &basalt());
    shows(&rig.cameras[0], AHEAD, [1_261.426_159_289, 863.452_086_964]);
    shows(&rig.cameras[1], BEHIND, [213.900_851_740, 1_485.685_322_004]);
    is_equidistant(&rig.cameras[2], [1024.0, 1022.0]);
    shows(&rig.cameras[3], AHEAD, [1_213.959_704_176, 895.213_435_405]);
    // ucm: u = fx x / (α d + (1 - α) z) + cx.
    let d = Vector3::from(AHEAD).norm();
    let depth = 0.6 * d + 0.4 * AHEAD[2];
    shows(&rig.cameras[4], AHEAD, [600.0 * AHEAD[0] / depth + 1024.0, 601.0 * AHEAD[1] / depth + 1022.0]);
    // Camera 1 is turned by 90° about y where it stands in the frame of the IMU.
    let pair = rig.pair(Some(["cam0", "cam1"])).expect("a pair");
    near(pair.left_from_right.origin().mm(), [110.0, 20.0, -30.0]);
    near(pair.left_from_right.rotation() * Vector3::z(), [1.0, 0.0, 0.0]);
    refused(&basalt().replace("\"kb4\"", "\"fov\""), &["camera_type 'fov'", "kb4"]);
    refused(&basalt().replacen("[2048, 2044],", "", 1), &["5 intrinsics, 5 T_imu_cam, 4 resolution"]);
    refused(&basalt().replacen("\"qw\": 1.0", "\"qw\": 1.5", 1), &["quaternion"]);
    refused(&basalt().replace("\"xi\"", "\"psi\""), &["intrinsics.0.intrinsics", "has no xi"]);
}

#[test]
fn sensors_of_euroc_pair_by_their_body() {
    let [left, right] = [euroc(0.0, "radial-tangential", FOUR), euroc(0.11, "equidistant", EQUI)];
    let [left, right] = [read(Format::Euroc, &left), read(Format::Euroc, &right)];
    shows(&left.cameras[0], AHEAD, [1_222.242_874_562, 889.682_118_292]);
    is_equidistant(&right.cameras[0], [1024.0, 1022.0]);
    let pair = ForeignPair::new(&left.cameras[0], &right.cameras[0]).expect("a pair");
    // T_BS turns the camera by 90° about z: its x is the body's y.
    near(pair.left_from_right.origin().mm(), [0.0, -110.0, 0.0]);
    refused(&euroc(0.0, "fov", FOUR), &["pinhole, fov", "not read"]);
    refused(&euroc(0.0, "equidistant", EQUI).replace("sensor_type: camera", "sensor_type: imu"), &["'imu'"]);
}

#[test]
fn camera_info_of_ros_in_all_its_spellings() {
    let plumb = ros("plumb_bob", "[-0.05, 0.01, 0.001, -0.0005, 0.0]", 0.0);
    shows(&read(Format::Ros, &plumb).cameras[0], AHEAD, [1_222.242_874_562, 889.682_118_292]);
    let right = read(Format::Ros, &ros("equidistant", EQUI, -72.0));
    is_equidistant(&right.cameras[0], [1024.0, 1022.0]);
    for echoed in [ros_echo("D", "K", "R", "P"), ros_echo("d", "k", "r", "p")] {
        is_equidistant(&read(Format::Ros, &echoed).cameras[0], [1024.0, 1022.0]);
    }
    // P says -fx B: 72 / 600 m.
    let left = read(Format::Ros, &plumb);
    let pair = ForeignPair::new(&left.cameras[0], &right.cameras[0]).expect("a pair");
    near(pair.left_from_right.origin().mm(), [120.0, 0.0, 0.0]);
    assert!(matches!(
        ForeignPair::new(&left.cameras[0], &read(Format::Ros, &plumb).cameras[0]),
        Err(ExchangeError::NoPose { .. })
    ));
    refused(&ros("thin_plate", FOUR, 0.0), &["this is a ROS camera_info", "thin_plate"]);
    refused(&ros("plumb_bob", "[1.0, 2.0, 3.0]", 0.0), &["3 numbers"]);
    refused(&plumb.replace("[600,", "[0,"), &["not calibrated"]);
}

#[test]
fn colmap_counts_pixels_from_the_corner() {
    let rig = read(Format::Colmap, COLMAP);
    assert_eq!(rig.names(), ["1", "2", "3", "7"]);
    is_equidistant(&rig.cameras[0], [1024.0, 1022.0]);
    shows(&rig.cameras[1], AHEAD, [1_222.242_874_562, 889.682_118_292]);
    shows(&rig.cameras[2], AHEAD, [600.0 / 3.0 + 1024.0, -600.0 * 2.0 / 9.0 + 1022.0]);
    shows(&rig.cameras[3], AHEAD, [1_213.959_704_176, 895.213_435_405]);
    assert!(matches!(rig.pair(Some(["1", "2"])), Err(ExchangeError::NoPose { .. })));
    refused("1 FOV 640 480 500 500 320 240 0.9\n", &["FOV", "not read"]);
    refused("1 PINHOLE 640 480 500 500 320\n", &["4 numbers"]);
    refused("1 PINHOLE 640 0 500 500 320 240\n", &["size"]);
    refused(&(COLMAP.to_owned() + "8 CUBE 640 480 1\n"), &["unknown model"]);
}

#[test]
fn settings_of_orb_slam_old_and_new() {
    for (text, names) in [(orb_slam_new(), ["Camera1", "Camera2"]), (orb_slam_old(), ["Camera", "Camera2"])] {
        let rig = read(Format::OrbSlam, &text);
        assert_eq!(rig.names(), names);
        rig.cameras.iter().for_each(|camera| is_equidistant(camera, [1024.0, 1022.0]));
        near(rig.pair(None).expect("a pair").left_from_right.origin().mm(), [101.0, -2.0, 3.0]);
    }
    let pinhole = "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 600.\nCamera.fy: 601.\nCamera.cx: 1024.\nCamera.cy: 1022.\n\
        Camera.k1: -0.05\nCamera.k2: 0.01\nCamera.p1: 0.001\nCamera.p2: -0.0005\nCamera.width: 2048\nCamera.height: 2044\n";
    shows(&read(Format::OrbSlam, pinhole).cameras[0], AHEAD, [1_222.242_874_562, 889.682_118_292]);
    refused(&pinhole.replace("PinHole", "Rectified"), &["Rectified", "not read"]);
    refused(&pinhole.replace("Camera.width: 2048\n", ""), &["has no Camera.width"]);
}

#[test]
fn ocamcalib_counts_rows_first_and_looks_backwards() {
    let rig = read(Format::OCam, OCAM);
    let camera = &rig.cameras[0];
    assert_eq!(camera.size, ImageSize { width: 1040, height: 1024 });
    // By the file's own direction: the ray of row 611, column 319.5 is (x, y, f(r)) with x down, y right and z backwards.
    let (down, right): (f64, f64) = (100.0, -200.0);
    let r = down.hypot(right);
    let backwards = -320.0 + 8.2e-4 * r * r - 6e-8 * r.powi(3) + 5e-10 * r.powi(4);
    let seen = camera.model.unproject(Pixel { u: 519.5 + right, v: 511.0 + down }).expect("in the field").ray;
    near(seen.vector(), Vector3::new(right, down, -backwards).normalize().into());
    refused(&OCAM.replace("5 -320", "4 -320"), &["not as many"]);
    refused(&OCAM.replace("1024 1040", "1024"), &["two numbers", "size"]);
    refused(&OCAM.replace("-320.0", "320.0"), &["no camera"]);
}

#[test]
fn realsense_prints_a_pair() {
    let rig = read(Format::RealSense, REALSENSE);
    assert_eq!(rig.names(), ["Fisheye 1", "Fisheye 2"]);
    rig.cameras.iter().for_each(|camera| is_equidistant(camera, [1024.0, 1022.0]));
    // Extrinsics map points of the first to the second, and rows are printed as rows: turned by 90° about y.
    let pair = rig.pair(None).expect("a pair");
    let second_from_first = pair.left_from_right.inverse();
    near(second_from_first.origin().mm(), [-64.0, 1.0, 2.0]);
    near(second_from_first.rotation() * Vector3::z(), [1.0, 0.0, 0.0]);
    refused(&REALSENSE.replace("Kannala Brandt4", "Ftheta"), &["Ftheta", "not read"]);
}

#[test]
fn opencv_says_its_model_or_is_refused() {
    let opencv = |more: &str, coefficients: &str| {
        format!(
            "%YAML:1.0\n---\n{more}image_size: [ 2048, 2044 ]\n{MATRIX}D: !!opencv-matrix\n   rows: 1\n   cols: 4\n   dt: d\n   data: {coefficients}\n"
        )
    };
    let text = |model: &str| opencv(model, EQUI);
    for stated in
        ["model: fisheye\n", "distortion_model: equidistant\n", "fisheye_model: 1\n", "camera_model: \"cv::fisheye\"\n"]
    {
        is_equidistant(&read(Format::OpenCv, &text(stated)).cameras[0], [1024.0, 1022.0]);
    }
    for stated in ["model: pinhole\n", "fisheye_model: 0\n", "distortion_model: plumb_bob\n"] {
        let text = opencv(stated, FOUR);
        shows(&read(Format::OpenCv, &text).cameras[0], AHEAD, [1_222.242_874_562, 889.682_118_292]);
    }
    refused(&text(""), &["four distortion coefficients", "model: fisheye", "model: pinhole"]);
    refused(&text("model: splines\n"), &["splines", "not known"]);
    refused(&opencv("model: fisheye\n", "[ 0.1, 0.2, 0.3, 0.4, 0.5 ]"), &["5 distortion coefficients"]);
    refused(&opencv("", "[ 0.1, 0.2, 0.3 ]"), &["3 distortion coefficients"]);
    refused(&text("model: omnidir\n"), &["xi"]);
    refused(&text("model: fisheye\n").replace("image_size", "size_of_it"), &["size of images", "image_width"]);
    refused(&text("model: fisheye\n").replace("600., 0.,", "600., 2.,"), &["skew of 2"]);
    refused(&text("model: fisheye\n").replace("0., 0., 1. ]", "0., 0., 2. ]"), &["no camera matrix"]);
    // The unit of a pair's T is that of the target's squares, which OpenCV does not know.
    refused(OPENCV_PAIR, &["translation_unit"]);
    let metres = read(Format::OpenCv, &(OPENCV_PAIR.to_owned() + "translation_unit: m\n"));
    near(metres.pair(None).expect("a pair").left_from_right.origin().mm(), [120.0, 0.0, 0.0]);
}

#[test]
fn what_is_not_read_is_named() {
    let unread = |text: &str| match Recognised::of(text) {
        Recognised::Unread { what, .. } => what,
        other => panic!("{other:?}"),
    };
    assert!(unread("%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 7\n").contains("camodocal"));
    assert!(unread("<?xml version=\"1.0\"?>\n<opencv_storage>\n").contains("XML"));
    assert!(unread("{\"K\": {\"type_id\": \"opencv-matrix\"}}").contains("JSON"));
    assert!(unread("# Image list with two lines of data per image:\n").contains("COLMAP"));
    assert!(unread("target_type: 'aprilgrid'\ntagCols: 6\n").contains("target"));
    assert!(unread("{\"fl_x\": 3}").contains("radiance"));
    assert!(unread("[LEFT_CAM_HD]\nfx=700.1\n").contains("ZED"));
    assert_eq!(Recognised::of("# a comment = no key\nwords\n"), Recognised::Unknown);
    assert_eq!(Recognised::of("name = \"rig\"\n"), Recognised::Ours);
    assert_eq!(Recognised::of("[left.camera]\n"), Recognised::Ours);
    assert_eq!(Recognised::of("words\n"), Recognised::Unknown);
    assert!(matches!(vergence_exchange::read("name = \"rig\"\n"), Err(ExchangeError::Unknown)));
}

#[test]
fn damaged_files_are_refused_or_read_but_never_panic() {
    let mut refused = 0;
    for text in samples::all() {
        for cut in (0..text.len()).step_by(11).filter(|cut| text.is_char_boundary(*cut)) {
            refused += u32::from(vergence_exchange::read(&text[..cut]).is_err());
        }
        for (from, to) in
            [("600", "-1e999"), ("0.0", "nan"), (": ", ": [] "), ("[", "[[["), ("2048", "0"), ("1.0", "{}")]
        {
            refused += u32::from(vergence_exchange::read(&text.replace(from, to)).is_err());
        }
    }
    assert!(refused > 500, "{refused}");
}

/// A radius with more terms than the format has is written as the nearest with four, and how far that is off is said.
#[test]
fn further_radial_terms_are_written_as_the_nearest_lens_without() {
    let drawn = equidistant(ImageSize { width: 2048, height: 2044 }, [1024.0, 1022.0]);
    let lens = drawn.with_further_terms([1e-5, -1e-6]).expect("a lens");
    let written = write(WriteFormat::Kalibr, &Cameras { left: lens, right: None }).expect("a file");
    assert!(written.remarks.iter().any(|remark| remark.contains("terms beyond θ⁹")), "{:?}", written.remarks);
    let read = read(Format::Kalibr, &written.files[0].text).cameras[0].lens().expect("a lens").lens;
    assert!(!read.has_further_terms() && read != drawn);
    let off = |other: &KannalaBrandt| lens.largest_difference(other, Length::from_mm(500.0));
    assert!(off(&read) < 0.1 * off(&drawn), "{} and {} px", off(&read), off(&drawn));
}
