//! Corners that are not equally good count by their relative sigmas.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use simulated::{Dice, Pair, error, lens, other_lens, own_views, pair_pose, seeds};
use vergence_calibration::{
    ExtrinsicsCalibration, ExtrinsicsOptions, IntrinsicsError, IntrinsicsOptions, StereoView, calibrate_extrinsics,
    calibrate_intrinsics,
};
use vergence_targets::{Corner, TargetView};
use vergence_vision::ImageSize;

/// Every third corner is so much worse than the others.
const WORSE: f64 = 8.0;
const NOISE_PX: f64 = 0.05;

fn pair() -> Pair {
    Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(60.0), noise_px: 0.0 }
}

/// Moves the corners by their noise, and says of each how large that is.
fn blur(corners: &mut [Corner], dice: &mut Dice) {
    for (index, corner) in corners.iter_mut().enumerate() {
        corner.relative_sigma = if index % 3 == 0 { WORSE } else { 1.0 };
        corner.pixel.u += NOISE_PX * corner.relative_sigma * dice.normal();
        corner.pixel.v += NOISE_PX * corner.relative_sigma * dice.normal();
    }
}

fn blurred_views(seed: u64) -> Vec<StereoView> {
    let mut dice = Dice::new(500 + seed);
    let mut views = pair().views(10, &mut dice);
    for view in &mut views {
        blur(&mut view.left.corners, &mut dice);
        blur(&mut view.right.corners, &mut dice);
    }
    views
}

/// The views with each relative sigma changed.
fn with_sigmas(views: &[StereoView], change: impl Fn(f64) -> f64) -> Vec<StereoView> {
    let mut views = views.to_vec();
    for corner in views.iter_mut().flat_map(|view| view.left.corners.iter_mut().chain(&mut view.right.corners)) {
        corner.relative_sigma = change(corner.relative_sigma);
    }
    views
}

fn calibrated(views: &[StereoView]) -> ExtrinsicsCalibration {
    calibrate_extrinsics(&lens(), &other_lens(), views, &ExtrinsicsOptions::default()).unwrap()
}

#[test]
fn stated_sigmas_improve_the_pose_and_correct_its_covariance() {
    let seeds = seeds(24);
    let (mut nees, mut squares, mut squares_unweighted) = (0.0, 0.0, 0.0);
    for seed in 0..seeds {
        let views = blurred_views(seed);
        let of = |found: &ExtrinsicsCalibration| error(&found.joint.left_from_right, &pair().left_from_right);
        let found = calibrated(&views);
        let off = of(&found);
        nees += (off.transpose() * found.covariance.try_inverse().unwrap() * off)[(0, 0)] / seeds as f64;
        squares += off.fixed_rows::<3>(3).norm_squared();
        squares_unweighted += of(&calibrated(&with_sigmas(&views, |_| 1.0))).fixed_rows::<3>(3).norm_squared();
    }
    let gain = (squares_unweighted / squares).sqrt();
    println!("{seeds} seeds: NEES {nees:.2}; unweighted, the position errs {gain:.1} times as much");
    // 99 % of all means of so many χ² of 6 degrees of freedom.
    let half = 2.576 * (12.0 / seeds as f64).sqrt();
    assert!((6.0 - half..6.0 + 1.2 * half).contains(&nees), "{nees}");
    // What the best weights could gain: √(mean(σ²) · mean(1/σ²)) = √(22 · 0.672) = 3.8. A robust fit without them loses
    // less, as it leaves out the worst.
    assert!(gain > 1.5, "{gain}");
}

#[test]
fn only_ratios_of_sigmas_count() {
    let views = blurred_views(0);
    let (one, many) = (calibrated(&views), calibrated(&with_sigmas(&views, |sigma| 16.0 * sigma)));
    let apart = error(&one.joint.left_from_right, &many.joint.left_from_right);
    assert!(apart.norm() < 1e-9, "{apart}");
    assert!((one.sigma_px - many.sigma_px).abs() < 1e-9 && one.outliers == many.outliers);
    assert!((one.covariance - many.covariance).norm() < 1e-6 * one.covariance.norm());
    // Of two good and one bad: √((1 + 1 + 64) / 3).
    assert!((one.sigma_px / (NOISE_PX * 22f64.sqrt()) - 1.0).abs() < 0.05, "{}", one.sigma_px);
}

#[test]
fn a_lens_has_its_sigmas_from_the_better_corners() {
    let mut dice = Dice::new(7);
    let mut views = own_views(&lens(), 20, 0.0, &mut dice);
    views.iter_mut().for_each(|view| blur(&mut view.corners, &mut dice));
    let equal: Vec<TargetView> = views
        .iter()
        .map(|view| TargetView {
            corners: view.corners.iter().map(|corner| Corner::new(corner.target_mm, corner.pixel)).collect(),
            ..view.clone()
        })
        .collect();
    let of = |views: &[TargetView]| {
        calibrate_intrinsics(views, ImageSize { width: 2048, height: 2048 }, &IntrinsicsOptions::default())
    };
    let (weighted, unweighted) = (of(&views).unwrap(), of(&equal).unwrap());
    assert!(weighted.covariance[(0, 0)] < 0.5 * unweighted.covariance[(0, 0)]);
    let off = (weighted.opencv.fx - lens().to_opencv().fx) / weighted.covariance[(0, 0)].sqrt();
    assert!(off.abs() < 3.0, "{off}");
    assert!(
        weighted.corners_inlier > unweighted.corners_inlier,
        "the worse corners are no outliers once their weights say how bad they are"
    );

    views[3].corners[5].relative_sigma = 0.0;
    assert_eq!(of(&views).unwrap_err(), IntrinsicsError::NotFinite { view: 3, corner: 5 });
}
