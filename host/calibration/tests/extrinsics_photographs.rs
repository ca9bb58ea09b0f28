//! Real photographs: the stereo pairs of sourishg/fisheye-stereo-calibration, corners by OpenCV 5.0.0, against SciPy's
//! bundle adjustment of the same corners. The data live outside the repository, see
//! `tests/common/data.rs`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that cannot go on fails, or says why it is skipped"
)]

#[path = "../../../tests/common/data.rs"]
mod data;

use data::real_data;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde_json::Value;
use vergence_calibration::{ExtrinsicsCalibration, ExtrinsicsOptions, LensKnowledge, StereoView, calibrate_extrinsics};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye, Pixel, Transform};

const SIZE: ImageSize = ImageSize { width: 960, height: 600 };

struct Photographs {
    views: Vec<StereoView>,
    reference: Value,
}

fn photographs() -> Option<Photographs> {
    let folder = real_data("data/sourishg_stereo")?;
    let table = csv::Reader::from_path(folder.join("corners_opencv_classic.csv")).unwrap();
    let text = std::fs::read_to_string(folder.join("reference_opencv_classic_cv5.json")).unwrap();
    Some(Photographs { views: read_views(table), reference: serde_json::from_str(&text).unwrap() })
}

fn read_views(mut table: csv::Reader<std::fs::File>) -> Vec<StereoView> {
    let mut sides: [std::collections::BTreeMap<u32, TargetView>; 2] = Default::default();
    for record in table.deserialize() {
        let (camera, name, frame, _, u, v, x, y): (String, String, u32, u32, f64, f64, f64, f64) = record.unwrap();
        let side = usize::from(camera == "right");
        let view = sides[side].entry(frame).or_insert_with(|| TargetView { name, corners: Vec::new() });
        view.corners.push(Corner::new([x, y], Pixel { u, v }));
    }
    let [left, right] = sides.map(|views| views.into_values().collect::<Vec<_>>());
    StereoView::pair(&left, &right).unwrap()
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap())
}

fn lens(value: &Value) -> KannalaBrandt {
    let [fx, fy, cx, cy, k1, k2, k3, k4] = numbers(value);
    let parameters = OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] };
    KannalaBrandt::from_opencv(parameters, parameters.largest_theta(SIZE).unwrap(), SIZE).unwrap()
}

/// Everything free, started at each camera's own calibration.
fn calibrate(photographs: &Photographs, robust: bool) -> ExtrinsicsCalibration {
    let mono = |side: &str| lens(&photographs.reference["mono"][side]["kb4_scipy_ba"]["fx_fy_cx_cy_k1_k2_k3_k4"]);
    let options = ExtrinsicsOptions { lenses: LensKnowledge::Free, robust };
    calibrate_extrinsics(&mono("left"), &mono("right"), &photographs.views, &options).unwrap()
}

#[test]
fn plain_least_squares_reaches_the_joint_optimum() {
    let Some(photographs) = photographs() else { return };
    let found = calibrate(&photographs, false);
    let optimum = photographs.reference["stereo"]["kb4_scipy_ba"]["rms_px"].as_f64().unwrap();
    println!("Arun {:.4} px, joint {:.6} px, SciPy {optimum:.6} px", found.arun.rms_px, found.joint.rms_px);
    assert!(found.joint.rms_px <= 1.001 * optimum);
    assert_eq!((found.corners_total, found.corners_inlier), (2052, 2052));
}

#[test]
fn without_gross_corners_the_pose_agrees_within_one_sigma() {
    let Some(photographs) = photographs() else { return };
    let found = calibrate(&photographs, true);
    let reference = &photographs.reference["stereo"]["kb4_scipy_ba_trimmed"];
    let trimmed = reference["rms_px"].as_f64().unwrap();
    println!(
        "inliers {:.6} px of {} corners of {}; SciPy {trimmed:.6} px",
        found.rms_inlier_px, found.corners_inlier, found.corners_total
    );
    for outlier in &found.outliers {
        println!(
            "{} {} {:?} {:.2} px {:?}",
            outlier.view, outlier.side, outlier.target_mm, outlier.error_px, outlier.reason
        );
    }
    assert!(found.rms_inlier_px <= 1.01 * trimmed);
    assert!(found.corners_inlier >= 2052 - 12);

    // The reference is right_from_left.
    let rows: [[f64; 3]; 3] = std::array::from_fn(|i| numbers(&reference["R"][i]));
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| rows[i][j]));
    let origin = Vector3::from(numbers::<3>(&reference["T_mm"]));
    let expected =
        Transform::<vergence_vision::Right, vergence_vision::Left>::new(UnitQuaternion::from(rotation), origin);
    let ours = found.joint.left_from_right.inverse();
    let turn = (ours.rotation() * expected.rotation().inverse()).scaled_axis().map(f64::to_degrees);
    let shift = ours.origin().mm() - origin;
    let sigma_turn = Vector3::from(numbers::<3>(&reference["sigma_rotvec_deg"]));
    let sigma_shift = Vector3::from(numbers::<3>(&reference["sigma_T_mm"]));
    let sigma = found.covariance.diagonal().map(f64::sqrt);
    println!(
        "off by {:.4?} sigmas and {:.4?} sigmas",
        turn.component_div(&sigma_turn),
        shift.component_div(&sigma_shift)
    );
    println!("sigma {:.5?} deg {:.4?} mm", sigma.fixed_rows::<3>(0).map(f64::to_degrees), sigma.fixed_rows::<3>(3));
    assert!((0..3).all(|i| turn[i].abs() <= sigma_turn[i] && shift[i].abs() <= sigma_shift[i]));
}
