//! The pose of a cloud by joints alone, and by joints and images.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use image::RgbImage;
use nalgebra::{Vector3, Vector6};
use vergence_pipeline::{PairCloud, PairPose, cloud_of_pairs};
use vergence_rig::{BENCH_TOML, Rig, RigCalibration, RigPose};
use vergence_vision::{Angle, Kernel, Left, Length, PixelPair, Point, SharedCovariance};

fn rig() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("a rig")
}

fn at(separation: f64) -> RigPose {
    rig().pose_read_at(&[145.0, f64::to_radians(separation)])
}

/// Where cameras with the axes at `separation` degrees see points in front of them, and these points in the left frame.
fn seen(separation: f64) -> (Vec<Point<Left>>, Vec<(PixelPair, f64)>) {
    let (rig, pose) = (rig(), at(separation));
    let half = f64::to_radians(separation / 2.0);
    let mut found = (Vec::new(), Vec::new());
    for number in 0..400 {
        let t = f64::from(number);
        let (azimuth, elevation, range) =
            (0.3 * (0.7 * t).sin() + half, 0.8 * (0.37 * t).cos(), 700.0 + 300.0 * (0.21 * t).sin());
        let direction = Vector3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let point = Point::<Left>::from_mm(direction * range);
        let left = rig.left_camera.project_point(&point);
        let right = rig.right_camera.project_point(&(pose.right_from_left() * point));
        if let (Ok(left), Ok(right)) = (left, right) {
            found.0.push(point);
            found.1.push((PixelPair { left, right }, 0.2));
        }
    }
    found
}

fn cloud(pose: RigPose, pairs: &[(PixelPair, f64)]) -> PairCloud {
    let image = RgbImage::new(1, 1);
    cloud_of_pairs(pairs, &image, &rig(), &PairPose::standing(pose), Kernel::default()).expect("a cloud")
}

/// Median relative error of the ranges.
fn off(cloud: &PairCloud, truth: &[Point<Left>]) -> f64 {
    let error = |index: usize, found: &Point<Left>| (found.mm().norm() / truth[index].mm().norm() - 1.0).abs();
    let mut errors: Vec<f64> =
        cloud.points.iter().map(|found| error(found.point.pair_index, &found.point.point)).collect();
    errors.sort_by(f64::total_cmp);
    errors.get(errors.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// The pose at 60 degrees, whose separation the joints know to 5 degrees.
fn badly_known() -> RigPose {
    let [stated, other] = [at(60.0), at(65.0)];
    let turn = (other.left_from_right.rotation() * stated.left_from_right.rotation().inverse()).scaled_axis();
    let shift = other.left_from_right.origin().mm() - stated.left_from_right.origin().mm();
    let twist = Vector6::from_iterator(turn.iter().chain(shift.iter()).copied());
    RigPose {
        shared: stated.shared.plus_pose(&(twist * twist.transpose())),
        rotation_sigma: Angle::from_deg(5.0),
        ..stated
    }
}

#[test]
fn images_tell_the_pose_that_the_joints_do_not() {
    let (truth, pairs) = seen(56.0);
    assert!(pairs.len() > 200, "{}", pairs.len());
    let found = cloud(badly_known(), &pairs);
    let fused = found.fused_pose.expect("a pose by both");
    assert!(fused.told_by_images > 0.8 && fused.told_by_joints() > 0.9, "{fused:?}");
    assert!(off(&found, &truth) < 0.01, "{}", off(&found, &truth));
    assert!(found.points.len() * 10 > pairs.len() * 9, "{} of {}", found.points.len(), pairs.len());
    // The joints alone, said to be sure of themselves.
    let sure = RigPose { shared: SharedCovariance::exact(), rotation_sigma: Angle::from_deg(0.02), ..badly_known() };
    let alone = cloud(sure, &pairs);
    assert_eq!(alone.fused_pose, None);
    assert!(alone.points.is_empty() || off(&alone, &truth) > 0.05, "{}", off(&alone, &truth));
}

/// Regression: the pose of a calibrated pair without joints was taken from one pair of images, and a misfit of the lenses with it.
#[test]
fn what_the_calibration_leaves_uncertain_is_not_taken_from_one_pair() {
    let (_, pairs) = seen(60.0);
    let calibration = RigCalibration::Sigmas { rotation: Angle::from_deg(1.0), translation: Length::from_mm(0.1) };
    let rig = Rig { calibration, ..rig() };
    let pose = rig.pose_read_at(&[145.0, 60f64.to_radians()]);
    assert!(pose.rotation_sigma.deg() > 0.9);
    let image = RgbImage::new(1, 1);
    let cloud = cloud_of_pairs(&pairs, &image, &rig, &PairPose::standing(pose), Kernel::default()).expect("a cloud");
    assert_eq!(cloud.fused_pose, None);
}

#[test]
fn joints_that_tell_the_pose_well_are_not_corrected() {
    let (_, pairs) = seen(60.3);
    let found = cloud(at(60.0), &pairs);
    assert_eq!(found.fused_pose, None);
    assert!(found.significant_drift().is_some(), "but the disagreement is told");
}
