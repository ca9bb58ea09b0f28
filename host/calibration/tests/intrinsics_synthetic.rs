//! Calibrations of simulated lenses, where the truth is known.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use nalgebra::{Isometry3, Matrix2, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_calibration::{
    IntrinsicsCalibration, IntrinsicsError, IntrinsicsOptions, OutlierReason, RayUncertainty, calibrate_intrinsics,
    reproject,
};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Camera, ImageSize, OpenCvFisheye, Pixel, Point, UnitRay};

const SIZE: ImageSize = ImageSize { width: 1200, height: 1100 };
/// A 196° lens whose image circle lies on the sensor.
const LENS: OpenCvFisheye =
    OpenCvFisheye { fx: 301.0, fy: 300.0, cx: 604.3, cy: 543.8, k: [-0.031, 0.004, -0.0021, 0.0003] };
/// Half of 196°.
const HALF_FIELD: f64 = 98.0 * std::f64::consts::PI / 180.0;

/// Standard normal, by G. Box and M. Muller, 1958.
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A target whose middle is seen at `theta` from the axis and `phi` around it, `range` mm away, facing the camera but
/// for turns by `tilt` about its own axes. All angles in radians.
fn pose(theta: f64, phi: f64, range: f64, tilt: [f64; 2]) -> Isometry3<f64> {
    let aim = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), phi)
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), theta)
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -phi);
    let tilt = UnitQuaternion::from_euler_angles(tilt[0], tilt[1], 0.3 * phi);
    Isometry3::from_parts(Translation3::from(aim * Vector3::new(0.0, 0.0, range)), aim * tilt)
}

/// The poses of a good set: middle, ring at 35°, ring at 75°.
fn poses() -> Vec<Isometry3<f64>> {
    let ring = |theta: f64, n: usize| {
        (0..n).map(move |i| {
            let phi = std::f64::consts::TAU * i as f64 / n as f64;
            pose(theta, phi, 240.0 + 10.0 * (i % 3) as f64, [0.5 * (3.0 * phi).cos(), 0.5 * (2.0 * phi + 1.0).sin()])
        })
    };
    ring(0.0, 3).chain(ring(0.6, 5)).chain(ring(1.3, 6)).collect()
}

/// Height of the target for a warp of `[along x, along y]` mm; corners span [-160, 160] × [-100, 100].
fn height([x, y]: [f64; 2], warp: [f64; 2]) -> f64 {
    warp[0] * (1.0 - (x / 160.0).powi(2)) + warp[1] * (1.0 - (y / 100.0).powi(2))
}

/// 9 × 6 corners at 40 mm as seen through [`LENS`] with noise of `sigma` px, those within the field.
fn view(index: usize, pose: &Isometry3<f64>, sigma: f64, warp: [f64; 2], rng: &mut Pcg64Mcg) -> TargetView {
    let place = |i: usize| [40.0 * (i % 9) as f64 - 160.0, 40.0 * (i / 9) as f64 - 100.0];
    let corners = (0..54).map(place).filter_map(|target_mm| {
        let point =
            Point::<Camera>::from_mm((pose * Point3::new(target_mm[0], target_mm[1], height(target_mm, warp))).coords);
        let seen = reproject(LENS, &point)?.pixel;
        let pixel = Pixel { u: seen[0] + sigma * normal(rng), v: seen[1] + sigma * normal(rng) };
        (point.direction()?.angle_to_axis().rad() < HALF_FIELD).then_some(Corner::new(target_mm, pixel))
    });
    TargetView { name: format!("view {index}"), corners: corners.collect() }
}

fn views(poses: &[Isometry3<f64>], sigma: f64, warp: [f64; 2], seed: u64) -> Vec<TargetView> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    poses.iter().enumerate().map(|(i, pose)| view(i, pose, sigma, warp, &mut rng)).collect()
}

fn good_views(sigma: f64, seed: u64) -> Vec<TargetView> {
    views(&poses(), sigma, [0.0; 2], seed)
}

fn calibrate(views: &[TargetView]) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    calibrate_intrinsics(views, SIZE, &IntrinsicsOptions::central())
}

fn parameters(lens: &OpenCvFisheye) -> nalgebra::SVector<f64, 8> {
    let [k1, k2, k3, k4] = lens.k;
    [lens.fx, lens.fy, lens.cx, lens.cy, k1, k2, k3, k4].into()
}

#[test]
fn exact_corners_give_the_exact_lens_past_90_degrees() {
    let calibration = calibrate(&good_views(0.0, 1)).unwrap();
    let error = parameters(&calibration.opencv) - parameters(&LENS);
    assert!(error.amax() < 1e-6, "{error}");
    assert!(calibration.outermost.deg() > 95.0, "{}", calibration.outermost);
    assert!(calibration.camera.theta_max() > calibration.outermost);
    assert_eq!(calibration.corners_inlier, calibration.corners_total);
    assert_eq!(calibration.outliers, []);
    for (view, pose) in calibration.views.iter().zip(poses()) {
        let found = view.pose.unwrap().camera_from_target;
        assert!((found.origin().mm() - pose.translation.vector).norm() < 1e-4);
        assert!(found.rotation().angle_to(&pose.rotation) < 1e-6);
    }
}

/// Over 60 seeds the normalised squared errors of 8 parameters sum to χ² with 480 degrees of freedom: its 99 % band is
/// [403.9, 563.6] (R, `qchisq(c(.005, .995), 480)`). The same for two directions of the ray at a pixel: 120 degrees of
/// freedom, [83.9, 163.6]; and for the six of a pose: 360, [294.3, 432.6].
#[test]
fn covariances_match_the_errors() {
    const SIGMA: f64 = 0.1;
    const SEEDS: u64 = 60;
    let pixel = Pixel { u: 250.0, v: 320.0 };
    let (mut lens, mut ray, mut target) = (0.0, 0.0, 0.0);
    let mut sigma0 = 0.0;
    for seed in 0..SEEDS {
        let calibration = calibrate(&good_views(SIGMA, 100 + seed)).unwrap();
        let error = parameters(&calibration.opencv) - parameters(&LENS);
        lens +=
            error.dot(&(calibration.covariance.fixed_view::<8, 8>(0, 0).into_owned().try_inverse().unwrap() * error));
        ray += ray_error(&calibration, pixel);
        let found = calibration.views[4].pose.unwrap();
        let truth = poses()[4];
        let turn = (found.camera_from_target.rotation() * truth.rotation.inverse()).scaled_axis();
        let shift = found.camera_from_target.origin().mm() - truth.translation.vector;
        let error = nalgebra::SVector::<f64, 6>::from([turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]);
        target += error.dot(&(found.covariance.try_inverse().unwrap() * error));
        sigma0 += calibration.sigma0_px / SEEDS as f64;
    }
    assert!((403.9..563.6).contains(&lens), "{lens}");
    assert!((83.9..163.6).contains(&ray), "{ray}");
    assert!((294.3..432.6).contains(&target), "{target}");
    assert!((sigma0 / SIGMA - 1.0).abs() < 0.01, "{sigma0}");
}

/// Normalised squared error of the ray at `pixel`.
fn ray_error(calibration: &IntrinsicsCalibration, pixel: Pixel) -> f64 {
    let truth: UnitRay<Camera> =
        vergence_vision::KannalaBrandt::from_opencv(LENS, calibration.camera.theta_max(), SIZE)
            .unwrap()
            .unproject(pixel)
            .unwrap();
    let found = RayUncertainty::of(calibration).at_with_rotation(pixel).unwrap();
    let difference = found.ray.vector() - truth.vector();
    let error = Vector2::new(found.tangents[0].dot(&difference), found.tangents[1].dot(&difference));
    error.dot(&(found.covariance.try_inverse().unwrap() * error))
}

#[test]
fn the_uncertainty_map_is_least_inside_the_targets_and_excludes_a_common_rotation() {
    let calibration = calibrate(&good_views(0.1, 7)).unwrap();
    let uncertainty = RayUncertainty::of(&calibration);
    let map = uncertainty.map(13, 11);
    assert_eq!(map.len(), 143);
    assert_eq!(map[0].ray, None, "the image's corner is outside the valid cone");
    let centre = map[5 * 13 + 6].ray.unwrap();
    assert!(centre.ray.angle_to_axis().deg() < 2.0);
    let edge = uncertainty.at(Pixel { u: 604.3 + 460.0, v: 543.8 }).unwrap();
    assert!(edge.ray.angle_to_axis().deg() > 90.0);
    assert!(edge.sigma() > centre.sigma(), "{} {}", edge.sigma(), centre.sigma());
    for point in map.iter().filter(|point| point.ray.is_some()) {
        let covariance = point.ray.unwrap().covariance;
        assert!(covariance.trace() > 0.0 && covariance.determinant() >= -1e-30);
    }
    // The mean over the field is what the common rotation is taken out of.
    let total = |f: &dyn Fn(Pixel) -> Matrix2<f64>| {
        map.iter().filter(|p| p.ray.is_some()).map(|p| f(p.pixel).trace()).sum::<f64>()
    };
    let without = total(&|pixel| uncertainty.at(pixel).unwrap().covariance);
    let with = total(&|pixel| uncertainty.at_with_rotation(pixel).unwrap().covariance);
    assert!(without < 0.8 * with, "{without} {with}");
}

/// The pupil moves the origin of a ray and does not turn it; its variance once counted as that of a point one millimetre away.
#[test]
fn directions_are_as_certain_whatever_is_known_of_the_pupil() {
    let calibration = calibrate(&good_views(0.1, 7)).unwrap();
    let mut covariance = calibration.covariance;
    (covariance[(8, 8)], covariance[(9, 9)]) = (9.0, 9.0);
    let ignorant = IntrinsicsCalibration { covariance, ..calibration.clone() };
    let pixel = Pixel { u: 250.0, v: 320.0 };
    let [known, unknown] = [&calibration, &ignorant].map(|of| RayUncertainty::of(of).at(pixel).unwrap().covariance);
    assert!((known - unknown).amax() < 1e-12 * known.amax(), "{known} {unknown}");
}

#[test]
fn a_bowed_target_is_found_out() {
    let warped = views(&poses(), 0.05, [0.8, -0.4], 3);
    let flat = calibrate(&warped).unwrap();
    let options = IntrinsicsOptions { warp: true, ..IntrinsicsOptions::central() };
    let calibration = calibrate_intrinsics(&warped, SIZE, &options).unwrap();
    let warp = calibration.warp.unwrap();
    assert!((warp.shape.along_x_mm - 0.8).abs() < 5.0 * warp.sigma_mm[0], "{warp:?}");
    assert!((warp.shape.along_y_mm + 0.4).abs() < 5.0 * warp.sigma_mm[1], "{warp:?}");
    assert!(warp.sigma_mm[0] < 0.05 && warp.sigma_mm[1] < 0.05, "{warp:?}");
    assert!(calibration.rms_inlier_px < 0.5 * flat.rms_inlier_px);
    assert_eq!(flat.warp, None);
}

#[test]
fn gross_errors_are_named() {
    let mut views = good_views(0.1, 11);
    for (view, corner, du) in [(0, 3, 40.0), (2, 17, -7.0), (5, 0, 300.0), (5, 1, 250.0)] {
        views[view].corners[corner].pixel.u += du;
    }
    let calibration = calibrate(&views).unwrap();
    let named: Vec<_> = calibration.outliers.iter().map(|o| (o.view, o.corner)).collect();
    assert_eq!(named, [(0, 3), (2, 17), (5, 0), (5, 1)]);
    assert!(calibration.outliers.iter().all(|o| o.reason == OutlierReason::TooFar && o.residual_px.unwrap() > 5.0));
}

#[test]
fn a_view_of_another_target_is_left_out() {
    let mut views = good_views(0.1, 12);
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for corner in &mut views[6].corners {
        corner.pixel = Pixel { u: rng.random_range(0.0..1200.0), v: rng.random_range(0.0..1100.0) };
    }
    let calibration = calibrate(&views).unwrap();
    assert_eq!(calibration.views_used, views.len() - 1);
    assert!(calibration.views[6].pose.is_none());
    assert!(calibration.outliers.iter().all(|o| o.view == 6 && o.reason == OutlierReason::ViewDisagrees));
    assert_eq!(calibration.outliers.len(), views[6].corners.len());
}

#[test]
fn the_order_of_views_and_corners_does_not_matter() {
    let views = good_views(0.2, 21);
    let expected = calibrate(&views).unwrap();
    let mut turned: Vec<_> = views.iter().cloned().rev().collect();
    turned.rotate_left(5);
    turned.iter_mut().for_each(|view| view.corners.reverse());
    let found = calibrate(&turned).unwrap();
    assert_eq!(found.opencv, expected.opencv);
    assert_eq!(found.covariance, expected.covariance);
    for view in &expected.views {
        let same = found.views.iter().find(|v| v.name == view.name).unwrap();
        assert_eq!(same, view);
    }
}

#[test]
fn one_view_is_refused() {
    let views = good_views(0.1, 1);
    assert_eq!(calibrate(&views[..1]).unwrap_err(), IntrinsicsError::TooFewViews { views: 1, needed: 2 });
    assert_eq!(calibrate(&[]).unwrap_err(), IntrinsicsError::TooFewViews { views: 0, needed: 2 });
}

#[test]
fn corners_that_are_no_numbers_are_refused() {
    let mut views = good_views(0.1, 1);
    views[3].corners[7].pixel.v = f64::NAN;
    assert_eq!(calibrate(&views).unwrap_err(), IntrinsicsError::NotFinite { view: 3, corner: 7 });
    let mut views = good_views(0.1, 1);
    views[2].corners[5].target_mm[0] = f64::INFINITY;
    assert_eq!(calibrate(&views).unwrap_err(), IntrinsicsError::NotFinite { view: 2, corner: 5 });
}

#[test]
fn duplicate_corners_are_refused() {
    let mut views = good_views(0.1, 1);
    views[1].corners[9].target_mm = views[1].corners[4].target_mm;
    assert_eq!(calibrate(&views).unwrap_err(), IntrinsicsError::DuplicateCorner { view: 1, corner: 9 });
    let mut views = good_views(0.1, 1);
    views[1].corners[3].pixel = views[1].corners[8].pixel;
    assert_eq!(calibrate(&views).unwrap_err(), IntrinsicsError::DuplicateCorner { view: 1, corner: 8 });
}

#[test]
fn too_few_corners_are_refused_or_left_out() {
    let mut views = good_views(0.1, 1);
    views.iter_mut().for_each(|view| view.corners.truncate(7));
    let refusal = IntrinsicsError::TooFewCorners { usable_views: 0, needed_views: 2, corners: 8 };
    assert_eq!(calibrate(&views).unwrap_err(), refusal);

    let mut views = good_views(0.1, 1);
    views[0].corners.truncate(7);
    views[1].corners.retain(|corner| corner.target_mm[1] < -99.0);
    let calibration = calibrate(&views).unwrap();
    let of = |view| calibration.outliers.iter().filter(move |o| o.view == view).map(|o| o.reason).collect::<Vec<_>>();
    assert_eq!(of(0), [OutlierReason::ViewTooSmall; 7]);
    assert_eq!(of(1), [OutlierReason::ViewOnALine; 9]);
}

#[test]
fn parallel_views_are_refused() {
    let slide = |i: usize| Isometry3::translation(40.0 * i as f64 - 60.0, 25.0 * i as f64, 180.0 + 50.0 * i as f64);
    for (sigma, turned) in [(0.0, 0.0), (0.1, 0.0), (0.1, 0.4)] {
        let tilt = Isometry3::rotation(Vector3::new(turned, 0.5 * turned, 0.0));
        let poses: Vec<_> = (0..6).map(|i| slide(i) * tilt).collect();
        let error = calibrate(&views(&poses, sigma, [0.0; 2], 9)).unwrap_err();
        assert!(matches!(error, IntrinsicsError::ParallelViews { .. }), "{sigma} {turned}: {error}");
    }
    // The same view twice is as parallel as views can be.
    let view = good_views(0.1, 1).remove(4);
    let error = calibrate(&[view.clone(), view]).unwrap_err();
    assert!(matches!(error, IntrinsicsError::ParallelViews { .. }), "{error}");
}

/// A target far away and hardly tilted determines neither its distance nor the focal length.
#[test]
fn a_weak_set_is_refused() {
    let tilts = [[0.0, 0.0], [0.07, 0.0], [0.0, 0.08], [-0.06, 0.02]];
    let poses: Vec<_> = tilts.iter().map(|&tilt| pose(0.1, 0.5, 3000.0, tilt)).collect();
    for seed in 0..5 {
        let error = calibrate(&views(&poses, 0.3, [0.0; 2], seed)).unwrap_err();
        let named = matches!(
            error,
            IntrinsicsError::Undetermined { .. } | IntrinsicsError::ParallelViews { .. } | IntrinsicsError::Singular
        );
        assert!(named, "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever finite numbers come in, an answer or a named error comes out.
    #[test]
    fn nonsense_never_panics(numbers in prop::collection::vec(prop::array::uniform4(any_size()), 27)) {
        let corners = |part: &[[f64; 4]]| {
            let corner = |&[x, y, u, v]: &[f64; 4]| Corner::new([x, y], Pixel { u, v });
            part.iter().map(corner).collect()
        };
        let views: Vec<_> = numbers.chunks(9).map(|part| TargetView { name: String::new(), corners: corners(part) }).collect();
        let _ = calibrate(&views);
    }
}

fn any_size() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3, prop::num::f64::ANY, (-10..10).prop_map(|i: i32| 1e30 * f64::from(i)), Just(0.0)]
}

#[test]
fn noise_is_no_target() {
    let mut rng = Pcg64Mcg::seed_from_u64(77);
    let mut views = good_views(0.1, 1);
    for corner in views.iter_mut().flat_map(|view| &mut view.corners) {
        corner.pixel = Pixel { u: rng.random_range(0.0..1200.0), v: rng.random_range(0.0..1100.0) };
    }
    calibrate(&views).unwrap_err();
}
