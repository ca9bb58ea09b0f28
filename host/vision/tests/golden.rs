//! The Kannala-Brandt projection and its import against numbers of other programs.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::Vector3;
use vergence_vision::{Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye, Pixel, UnitRay};

const SIZE: ImageSize = ImageSize { width: 1920, height: 1536 };

fn bench() -> OpenCvFisheye {
    OpenCvFisheye { fx: 600.0, fy: 598.5, cx: 959.5, cy: 767.5, k: [0.01, -0.004, 0.001, -0.0002] }
}

fn assert_projects(vectors: &[([f64; 3], [f64; 2])]) {
    let lens = KannalaBrandt::from_opencv(bench(), Angle::from_deg(99.5), SIZE).unwrap();
    for &(vector, [u, v]) in vectors {
        let ray = UnitRay::<Camera>::new(Vector3::from(vector)).unwrap();
        let pixel = lens.project(&ray).unwrap();
        assert!((pixel.u - u).hypot(pixel.v - v) < 1e-9, "{vector:?}: {pixel:?}, expected {u} {v}");
    }
}

/// OpenCV 5.0.0 (`opencv-python-headless`):
/// `cv2.fisheye.projectPoints(P, zeros(3), zeros(3), [[600,0,959.5],[0,598.5,767.5],[0,0,1]],
/// [0.01,-0.004,0.001,-0.0002])`; a 40-digit evaluation of the formula agrees to 1e-12 px.
#[test]
fn projects_as_opencv_below_80_degrees() {
    assert_projects(&[
        ([0.0, 0.0, 1.0], [959.5, 767.5]),
        ([0.1, 0.2, 1.0], [1018.5569891320026, 885.3186933183453]),
        ([-0.7, 0.4, 1.0], [604.6658530045277, 969.7554637874193]),
        ([2.0, -1.0, 1.0], [1581.6917034387943, 457.1818879099014]),
        ([-3.0, -4.0, 1.0], [460.7197887425181, 104.12231902754911]),
        ([1.0, 5.0, 1.1], [1120.7396668871413, 1571.6828385996173]),
    ]);
}

/// mpmath 1.4 with 40 digits: `t = atan2(hypot(x, y), z); td = t*(1 + sum(k[i]*t**(2*i+2)));
/// u = 959.5 + 600*td*x/hypot(x, y); v = 767.5 + 598.5*td*y/hypot(x, y)`.
#[test]
fn projects_as_the_formula_from_90_degrees_on() {
    assert_projects(&[
        ([1.0, 0.0, 0.0], [1909.452144077194, 767.5]),
        ([0.0, -1.0, -0.1], [959.5, -238.6317692553269]),
        ([3.0, 4.0, -0.5], [1564.69204165734, 1572.405415404262]),
        ([-2.0, 1.0, -0.3], [39.85370336309921, 1226.173590447654]),
        ([-1.0, -1.0, -0.2], [229.552567402102, 39.37743598359675]),
    ]);
}

#[test]
fn opencv_parameters_survive_the_round_trip() {
    let lens = KannalaBrandt::from_opencv(bench(), Angle::from_deg(98.0), SIZE).unwrap();
    let (there, back) = (bench(), lens.to_opencv());
    let flat = |c: OpenCvFisheye| [[c.fx, c.fy, c.cx, c.cy], c.k];
    for (a, b) in flat(there).as_flattened().iter().zip(flat(back).as_flattened()) {
        assert!((a - b).abs() <= 1e-13 * a.abs(), "{a} became {b}");
    }
}

#[test]
fn opencv_parameters_of_no_lens_are_refused() {
    let theta = Angle::from_deg(98.0);
    for (fx, fy) in [(0.0, 600.0), (600.0, 0.0), (-600.0, -600.0)] {
        let camera = OpenCvFisheye { fx, fy, ..bench() };
        assert_eq!(KannalaBrandt::from_opencv(camera, theta, SIZE), Err(InvalidLens::FocalLength));
        assert_eq!(camera.largest_theta(SIZE), Err(InvalidLens::FocalLength));
    }
    for camera in [OpenCvFisheye { fx: f64::NAN, ..bench() }, OpenCvFisheye { cy: f64::INFINITY, ..bench() }] {
        assert_eq!(KannalaBrandt::from_opencv(camera, theta, SIZE), Err(InvalidLens::NotFinite));
        assert_eq!(camera.largest_theta(SIZE), Err(InvalidLens::NotFinite));
    }
}

/// r = 600 θ: the farthest of the corners (±960, ±768) px from the centre is at hypot(960, 768) / 600 rad.
#[test]
fn largest_theta_is_the_farthest_corner_of_a_growing_lens() {
    let lens = OpenCvFisheye { fx: 600.0, fy: 600.0, cx: 959.5, cy: 767.5, k: [0.0; 4] };
    let theta = lens.largest_theta(SIZE).unwrap();
    assert!((theta.rad() - 960f64.hypot(768.0) / 600.0).abs() < 1e-12, "{theta}");
    let shifted = OpenCvFisheye { cx: 1000.5, ..lens }.largest_theta(SIZE).unwrap();
    assert!((shifted.rad() - 1001f64.hypot(768.0) / 600.0).abs() < 1e-12, "{shifted}");
}

/// r = 600 (θ - θ³/10): dr/dθ is zero at θ = sqrt(10/3).
#[test]
fn largest_theta_keeps_below_the_turn() {
    let k = [600.0, -60.0, 0.0, 0.0, 0.0];
    let centre = Pixel { u: 959.5, v: 767.5 };
    let turn = (10.0f64 / 3.0).sqrt();
    let lens = OpenCvFisheye { fx: 600.0, fy: 600.0, cx: centre.u, cy: centre.v, k: [-0.1, 0.0, 0.0, 0.0] };
    let theta = lens.largest_theta(SIZE).unwrap();
    assert!((theta.rad() - 0.99 * turn).abs() < 1e-12, "{theta}");
    assert!(KannalaBrandt::new(k, 1.0, centre, theta, SIZE).is_ok());
    match KannalaBrandt::new(k, 1.0, centre, Angle::from_deg(120.0), SIZE) {
        Err(InvalidLens::TurnsOver { turn: found, .. }) => assert!((found.rad() - turn).abs() < 1e-12, "{found}"),
        other => panic!("accepted a lens that turns over: {other:?}"),
    }
}
