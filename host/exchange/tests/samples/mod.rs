//! Files as other programs write them, with made-up numbers.
#![allow(dead_code, reason = "each test file uses its own part")]

/// Coefficients k1 k2 p1 p2 of a pinhole.
pub const FOUR: &str = "[-0.05, 0.01, 0.001, -0.0005]";
/// Coefficients k1 to k4 of a fisheye.
pub const EQUI: &str = "[-0.02, 0.003, -0.001, 0.0002]";
pub const EQUIDISTANT: [f64; 4] = [-0.02, 0.003, -0.001, 0.0002];
pub const MATRIX: &str =
    "K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 600., 0., 1024., 0., 601., 1022., 0., 0., 1. ]\n";

pub fn kalibr_camera(name: &str, model: &str, distortion: &str, intrinsics: &str, coefficients: &str) -> String {
    format!(
        "{name}:\n  cam_overlaps: [1]\n  camera_model: {model}\n  distortion_coeffs: {coefficients}\n  distortion_model: {distortion}\n  \
         intrinsics: {intrinsics}\n  resolution: [2048, 2044]\n  rostopic: /cam0/image_raw\n"
    )
}

/// Three cameras, each 100 mm to the right of the one before in its frame, and turned by 90° about y.
pub fn kalibr_chain() -> String {
    // The camera before, seen from this one: x_n = R x_(n-1) + t with R the turn back.
    let link = "  T_cn_cnm1:\n  - [0.0, 0.0, -1.0, 0.0]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [1.0, 0.0, 0.0, -0.1]\n  - [0.0, 0.0, 0.0, 1.0]\n";
    let camera = |name| kalibr_camera(name, "pinhole", "equidistant", "[600, 601, 1024, 1022]", EQUI);
    format!("{}{}{link}{}{link}", camera("cam0"), camera("cam1"), camera("cam2"))
}

/// One camera of each model of Basalt.
pub fn basalt() -> String {
    let upright = r#"{"px": 0.01, "py": 0.02, "pz": 0.03, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}"#;
    let turned = r#"{"px": 0.12, "py": 0.04, "pz": 0.0, "qx": 0.0, "qy": 0.7071067811865476, "qz": 0.0, "qw": 0.7071067811865476}"#;
    let model = |kind: &str, own: &str| {
        format!(
            r#"{{"camera_type": "{kind}", "intrinsics": {{"fx": 600.0, "fy": 601.0, "cx": 1024.0, "cy": 1022.0{own}}}}}"#
        )
    };
    let models = [
        model("ds", r#", "xi": -0.2, "alpha": 0.6"#),
        model("eucm", r#", "alpha": 0.65, "beta": 1.1"#),
        model("kb4", r#", "k1": -0.02, "k2": 0.003, "k3": -0.001, "k4": 0.0002"#),
        model(
            "pinhole-radtan8",
            r#", "k1": 0.2, "k2": -0.1, "p1": 0.001, "p2": -0.0005, "k3": 0.02, "k4": 0.5, "k5": 0.1, "k6": 0.01, "rpmax": 0.0"#,
        ),
        model("ucm", r#", "alpha": 0.6"#),
    ];
    format!(
        r#"{{"value0": {{"T_imu_cam": [{upright}, {turned}, {upright}, {upright}, {upright}], "intrinsics": [{}],
        "resolution": [[2048, 2044], [2048, 2044], [2048, 2044], [2048, 2044], [2048, 2044]], "cam_time_offset_ns": 0}}}}"#,
        models.join(", ")
    )
}

/// A camera `x` metres along the body's x.
pub fn euroc(x: f64, distortion: &str, coefficients: &str) -> String {
    format!(
        "# General sensor definitions.\nsensor_type: camera\ncomment: a test\n\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0.0, -1.0, 0.0, {x:?},\n         \
         1.0, 0.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\n\nrate_hz: 20\nresolution: [2048, 2044]\n\
         camera_model: pinhole\nintrinsics: [600, 601, 1024, 1022] #fu, fv, cu, cv\ndistortion_model: {distortion}\n\
         distortion_coefficients: {coefficients}\n"
    )
}

/// As camera_calibration of ROS writes it; `along` is the fourth number of P.
pub fn ros(distortion: &str, coefficients: &str, along: f64) -> String {
    format!(
        "image_width: 2048\nimage_height: 2044\ncamera_name: left\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
         data: [600, 0, 1024, 0, 601, 1022, 0, 0, 1]\ndistortion_model: {distortion}\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  \
         data: {coefficients}\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n\
         projection_matrix:\n  rows: 3\n  cols: 4\n  data: [600, 0, 1024, {along:?}, 0, 601, 1022, 0, 0, 0, 1, 0]\n"
    )
}

/// As a topic is echoed, twice.
pub fn ros_echo(d: &str, k: &str, r: &str, p: &str) -> String {
    let one = format!(
        "header:\n  stamp:\n    sec: 1\n  frame_id: cam\nheight: 2044\nwidth: 2048\ndistortion_model: equidistant\n{d}: {EQUI}\n\
         {k}: [600.0, 0.0, 1024.0, 0.0, 601.0, 1022.0, 0.0, 0.0, 1.0]\n{r}: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n\
         {p}: [600.0, 0.0, 1024.0, 0.0, 0.0, 601.0, 1022.0, 0.0, 0.0, 0.0, 1.0, 0.0]\nbinning_x: 0\nroi:\n  x_offset: 0\n---\n"
    );
    one.clone() + &one
}

pub const COLMAP: &str = "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n\
    # Number of cameras: 4\n1 OPENCV_FISHEYE 2048 2044 600 601 1024.5 1022.5 -0.02 0.003 -0.001 0.0002\n\
    2 OPENCV 2048 2044 600 601 1024.5 1022.5 -0.05 0.01 0.001 -0.0005\n3 SIMPLE_PINHOLE 2048 2044 600 1024.5 1022.5\n\
    7 FULL_OPENCV 2048 2044 600 601 1024.5 1022.5 0.2 -0.1 0.001 -0.0005 0.02 0.5 0.1 0.01\n";

fn orb_slam_camera(name: &str) -> String {
    format!(
        "{name}.fx: 600.0\n{name}.fy: 601.0\n{name}.cx: 1024.0\n{name}.cy: 1022.0\n{name}.k1: -0.02\n{name}.k2: 0.003\n{name}.k3: -0.001\n\
         {name}.k4: 0.0002\n"
    )
}

pub fn orb_slam_new() -> String {
    format!(
        "%YAML:1.0\n\n# Camera Parameters.\nFile.version: \"1.0\"\n\nCamera.type: \"KannalaBrandt8\"\n{}{}\nCamera.width: 2048\nCamera.height: 2044\n\
         Stereo.ThDepth: 40.0\nStereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [1.0, 0.0, 0.0, 0.101,\n         \
         0.0, 1.0, 0.0, -0.002,\n         0.0, 0.0, 1.0, 0.003,\n         0.0, 0.0, 0.0, 1.0]\n",
        orb_slam_camera("Camera1"),
        orb_slam_camera("Camera2")
    )
}

pub fn orb_slam_old() -> String {
    format!(
        "%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\n{}{}Tlr: !!opencv-matrix\n   rows: 3\n   cols: 4\n   dt: f\n   \
         data: [1.0, 0.0, 0.0, 0.101,\n          0.0, 1.0, 0.0, -0.002,\n          0.0, 0.0, 1.0, 0.003]\nCamera.width: 2048\nCamera.height: 2044\n",
        orb_slam_camera("Camera"),
        orb_slam_camera("Camera2")
    )
}

pub const OCAM: &str = "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). These are used by cam2world\n\n\
    5 -320.0 0.0 8.2e-4 -6e-8 5e-10 \n\n#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB). These are used by world2cam\n\n\
    4 500.0 300.0 10.0 20.0 \n\n#center: \"row\" and \"column\", starting from 0 (C convention)\n\n511.0 519.5\n\n#affine parameters \"c\", \"d\", \"e\"\n\n\
    1.0 0.0 0.0\n\n#image size: \"height\" and \"width\"\n\n1024 1040\n\n";

pub const REALSENSE: &str = "Device info: \n    Name                          : \tIntel RealSense T265\n\n\
    Intrinsic Parameters:\n\n Intrinsic of \"Fisheye 1\" / 2048x2044 / {Y8}\n  Width:      \t2048\n  Height:     \t2044\n  PPX:        \t1024\n  \
    PPY:        \t1022\n  Fx:         \t600\n  Fy:         \t601\n  Distortion: \tKannala Brandt4\n  Coeffs:     \t-0.02  \t0.003  \t-0.001  \t0.0002  \t0  \n  \
    FOV (deg):  \t119.3 x 119.1\n\n Intrinsic of \"Fisheye 2\" / 2048x2044 / {Y8}\n  Width:      \t2048\n  Height:     \t2044\n  PPX:        \t1024\n  \
    PPY:        \t1022\n  Fx:         \t600\n  Fy:         \t601\n  Distortion: \tKannala Brandt4\n  Coeffs:     \t-0.02  \t0.003  \t-0.001  \t0.0002  \t0  \n  \
    FOV (deg):  \t119.3 x 119.1\n\nMotion Intrinsic Parameters:\n\nMotion Intrinsic of \"Gyro\"\t  MOTION_XYZ32F\nBias Variances: \t0  0  0  \n\n\
    Extrinsic Parameters:\nExtrinsic from \"Fisheye 1\"\t  To\t  \"Fisheye 1\" :\n Rotation Matrix:\n   1 0 0\n   0 1 0\n   0 0 1\n\n \
    Translation Vector: 0  0  0  \n\nExtrinsic from \"Fisheye 1\"\t  To\t  \"Fisheye 2\" :\n Rotation Matrix:\n   0.0          0.0          1.0         \n   \
    0.0          1.0          0.0         \n  -1.0          0.0          0.0         \n\n Translation Vector: -0.064  0.001  0.002  \n\n";

pub const OPENCV_PAIR: &str = "%YAML:1.0\n---\nimage_width: 2048\nimage_height: 2044\nmodel: fisheye\n\
    M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 600., 0., 1024., 0., 601., 1022., 0., 0., 1. ]\n\
    D1: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.02, 0.003, -0.001, 0.0002 ]\n\
    M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 600., 0., 1024., 0., 601., 1022., 0., 0., 1. ]\n\
    D2: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.02, 0.003, -0.001, 0.0002 ]\n\
    R: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\n\
    T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ -0.12, 0., 0. ]\n";

/// A file of every format.
pub fn all() -> Vec<String> {
    vec![
        kalibr_chain(),
        basalt(),
        euroc(0.0, "equidistant", EQUI),
        ros("equidistant", EQUI, 0.0),
        COLMAP.to_owned(),
        orb_slam_new(),
        OCAM.to_owned(),
        REALSENSE.to_owned(),
        OPENCV_PAIR.to_owned() + "translation_unit: mm\n",
        "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [600, 601, 1024, 1022,], 'extrinsics': [0,0,0,0,0,0,], 'imagersize': [2048, 2044,],}"
            .to_owned(),
    ]
}
