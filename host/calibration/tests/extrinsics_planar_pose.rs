//! The target pose from one bundle of rays: as accurate at 120° from the axis as on it, and never the wrong tilt.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use simulated::{Dice, facing_target, median, photograph};
use vergence_calibration::{PoseError, target_pose};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Pixel};

/// An equidistant lens of 560 px/rad up to `theta_max_deg`, on a sensor large enough for all of it.
fn equidistant(theta_max_deg: f64) -> KannalaBrandt {
    let centre = Pixel { u: 1500.0, v: 1500.0 };
    let size = ImageSize { width: 3001, height: 3001 };
    KannalaBrandt::new([560.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(theta_max_deg), size).unwrap()
}

/// 9 x 6 corners of 20 mm, the target's centre at 350 mm and `theta_deg` from the axis, tilted by 25°.
fn view_at(camera: &KannalaBrandt, theta_deg: f64, noise_px: f64, dice: &mut Dice) -> (Isometry3<f64>, TargetView) {
    let (theta, phi) = (theta_deg.to_radians(), dice.between(0.0, std::f64::consts::TAU));
    let ray = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &ray)
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
    let towards = dice.between(0.0, std::f64::consts::TAU);
    let tilt = Vector3::new(towards.cos(), towards.sin(), 0.0) * 25f64.to_radians();
    let rotation = facing * UnitQuaternion::from_scaled_axis(tilt);
    let pose =
        Isometry3::from_parts(Translation3::from(ray * 350.0 - rotation * Vector3::new(80.0, 50.0, 0.0)), rotation);
    let mut corners = Vec::new();
    for index in 0..54 {
        let target_mm = [f64::from(index % 9) * 20.0, f64::from(index / 9) * 20.0];
        let point = pose * nalgebra::Point3::new(target_mm[0], target_mm[1], 0.0);
        let point = vergence_vision::Point::<vergence_vision::Camera>::from_mm(point.coords);
        let exact = camera.project_point(&point).unwrap();
        let pixel = Pixel { u: exact.u + noise_px * dice.normal(), v: exact.v + noise_px * dice.normal() };
        corners.push(Corner::new(target_mm, pixel));
    }
    (pose, TargetView { name: String::new(), corners })
}

/// Rotation in degrees and translation in millimetres between the truth and the estimate.
fn errors(truth: &Isometry3<f64>, camera: &KannalaBrandt, view: &TargetView) -> (f64, f64) {
    let found = target_pose(camera, view).unwrap();
    let pose = found.camera_from_target.isometry();
    let rotation = truth.rotation.angle_to(&pose.rotation).to_degrees();
    (rotation, (truth.translation.vector - pose.translation.vector).norm())
}

/// Median errors of 0.1 px corners: about 0.04° and 0.05 mm at any angle to the axis; less far out, where this lens
/// stretches along the circles.
#[test]
fn accuracy_does_not_depend_on_the_angle_to_the_axis() {
    let camera = equidistant(160.0);
    for theta in [0.0, 30.0, 70.0, 90.0, 98.0, 120.0] {
        let mut dice = Dice::new(theta as u64);
        let (mut rotation, mut translation) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            let (pose, view) = view_at(&camera, theta, 0.1, &mut dice);
            let (turn, shift) = errors(&pose, &camera, &view);
            rotation.push(turn);
            translation.push(shift);
        }
        let worst = translation.iter().copied().fold(0.0, f64::max);
        let (rotation, translation) = (median(rotation), median(translation));
        println!("{theta}°: {rotation:.4}° {translation:.4} mm, at most {worst:.3} mm");
        assert!((0.025..0.055).contains(&rotation) && (0.03..0.075).contains(&translation) && worst < 0.4);
    }
}

/// The wrong tilt would be tens of degrees off.
#[test]
fn the_other_tilt_is_never_taken_for_the_pose() {
    let camera = equidistant(160.0);
    for (noise_px, most_wrong) in [(0.1, 0), (1.0, 0), (3.0, 2)] {
        let mut dice = Dice::new(17);
        let wrong = (0..300).filter(|index| {
            let (pose, view) = view_at(&camera, f64::from(index % 110), noise_px, &mut dice);
            errors(&pose, &camera, &view).0 > 15.0
        });
        let wrong = wrong.count();
        println!("{noise_px} px: {wrong} of 300 with the wrong tilt");
        assert!(wrong <= most_wrong);
    }
}

/// From afar both tilts fit: the pose says so.
#[test]
fn an_ambiguous_tilt_is_reported() {
    let camera = equidistant(160.0);
    let mut dice = Dice::new(2);
    let target = facing_target(&mut dice, Vector3::new(0.0, 0.0, 8000.0), 30.0);
    let view = photograph(&camera, &target, 0.1, &mut dice);
    let far = target_pose(&camera, &view).unwrap();
    assert!(far.other_tilt_rms_px.unwrap() < 2.0 * far.rms_px);
    let (_, near) = view_at(&camera, 60.0, 0.1, &mut dice);
    let near = target_pose(&camera, &near).unwrap();
    assert!(near.other_tilt_rms_px.is_none_or(|other| other > 5.0 * near.rms_px));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn exact_corners_give_the_exact_pose(seed in 0u64..1_000_000, theta in 0.0..130f64) {
        let camera = equidistant(160.0);
        let (pose, view) = view_at(&camera, theta, 0.0, &mut Dice::new(seed));
        let (rotation, translation) = errors(&pose, &camera, &view);
        prop_assert!(rotation < 1e-7 && translation < 1e-7, "{rotation}° {translation} mm");
    }

    /// Four corners in general position are enough.
    #[test]
    fn four_corners_suffice(seed in 0u64..1_000_000, theta in 0.0..110f64) {
        let camera = equidistant(160.0);
        let (pose, mut view) = view_at(&camera, theta, 0.0, &mut Dice::new(seed));
        view.corners = [0, 8, 45, 53].map(|index| view.corners[index]).to_vec();
        let (rotation, translation) = errors(&pose, &camera, &view);
        prop_assert!(rotation < 1e-6 && translation < 1e-6, "{rotation}° {translation} mm");
    }

    /// Whatever comes in, nothing panics.
    #[test]
    fn any_corners_end_in_a_pose_or_a_reason(
        corners in prop::collection::vec((any::<[f64; 2]>(), any::<[f64; 2]>()), 0..12),
    ) {
        let corners =
            corners.into_iter().map(|(target_mm, [u, v])| Corner::new(target_mm, Pixel { u, v })).collect();
        let _ = target_pose(&equidistant(98.0), &TargetView { name: String::new(), corners });
    }
}

#[test]
fn refusals_are_named() {
    let camera = equidistant(98.0);
    let (_, view) = view_at(&camera, 20.0, 0.1, &mut Dice::new(1));
    let with = |corners: Vec<Corner>| target_pose(&camera, &TargetView { name: String::new(), corners });
    assert_eq!(with(view.corners[..3].to_vec()), Err(PoseError::TooFewCorners(3)));
    assert_eq!(with(view.corners[..9].to_vec()), Err(PoseError::Degenerate));
    assert_eq!(with([&view.corners[..4], &view.corners[..1]].concat()), Err(PoseError::Duplicate([0.0, 0.0])));
    let mut broken = view.corners.clone();
    broken[7].target_mm[1] = f64::INFINITY;
    assert_eq!(with(broken), Err(PoseError::NotFinite));
    let mut outside = view.corners;
    outside[0].pixel = Pixel { u: 0.0, v: 0.0 };
    assert_eq!(with(outside).map(|pose| (pose.corners, pose.outside)), Ok((53, 1)));
}
