//! Held-out views and stage poses: prediction errors, and the faults that they reveal.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, Pair, lens, other_lens, own_views, pair_pose};
use vergence_calibration::{
    ExtrinsicsOptions, IntrinsicsOptions, StageError, StageOptions, StagePose, Validation, calibrate_extrinsics,
    calibrate_intrinsics, validate_extrinsics, validate_intrinsics, validate_stage,
};
use vergence_rig::AxisPosition;
use vergence_vision::Length;

const NOISE_PX: f64 = 0.1;

/// Noise of σ per axis leaves √2 σ of distance, a little more where the calibration had to guess.
#[test]
fn held_out_views_show_the_noise_and_a_little_more() {
    let views = own_views(&lens(), 20, NOISE_PX, &mut Dice::new(1));
    let options = IntrinsicsOptions::default();
    let found = calibrate_intrinsics(&views, lens().size(), &options).unwrap();
    let held_out = validate_intrinsics(&views, lens().size(), &options, &found, 5).unwrap();
    println!("lens: {} px used, {} px held out", found.rms_inlier_px, held_out.rms_px);
    assert_eq!((held_out.folds, held_out.views.len()), (5, 20));
    assert!(held_out.rms_px > found.rms_inlier_px && held_out.rms_px < 1.15 * found.rms_inlier_px);
    assert!(held_out.is_sound(found.rms_inlier_px));

    let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(60.0), noise_px: NOISE_PX };
    let views = pair.views(12, &mut Dice::new(2));
    let options = ExtrinsicsOptions::default();
    let found = calibrate_extrinsics(&pair.left, &pair.right, &views, &options).unwrap();
    let held_out = validate_extrinsics((&pair.left, &pair.right), &views, &options, &found, 4).unwrap();
    println!("pair: {} px used, {} px held out", found.rms_inlier_px, held_out.rms_px);
    assert_eq!(held_out.views.len(), 12);
    assert!((held_out.rms_px / found.rms_inlier_px - 1.0).abs() < 0.1 && held_out.is_sound(found.rms_inlier_px));
}

/// A gross error that the calibration left out says nothing of it.
#[test]
fn corners_left_out_do_not_count() {
    let mut views = own_views(&lens(), 16, NOISE_PX, &mut Dice::new(3));
    views[4].corners[7].pixel.u += 60.0;
    let options = IntrinsicsOptions::default();
    let found = calibrate_intrinsics(&views, lens().size(), &options).unwrap();
    assert_eq!(found.outliers.len(), 1);
    let held_out = validate_intrinsics(&views, lens().size(), &options, &found, 4).unwrap();
    assert!(held_out.rms_px < 1.2 * found.rms_inlier_px, "{}", held_out.rms_px);
}

/// So few corners that the calibration bends to them: what it did not see fits worse, and twice as bad is not sound.
#[test]
fn a_lens_that_fits_its_own_views_only_is_found_out() {
    let mut views = own_views(&lens(), 6, 3.0 * NOISE_PX, &mut Dice::new(4));
    for view in &mut views {
        let mut index = 0;
        view.corners.retain(|_| {
            index += 1;
            index % 4 == 1
        });
    }
    let options = IntrinsicsOptions { outlier_factor: None, ..IntrinsicsOptions::default() };
    let found = calibrate_intrinsics(&views, lens().size(), &options).unwrap();
    let held_out = validate_intrinsics(&views, lens().size(), &options, &found, 3).unwrap();
    println!("few corners: {} px used, {} px held out", found.rms_inlier_px, held_out.rms_px);
    assert!(held_out.rms_px > 1.1 * found.rms_inlier_px);
    let bad = Validation { rms_px: 2.1 * found.rms_inlier_px, ..held_out.clone() };
    assert!(held_out.is_sound(held_out.rms_px) && !bad.is_sound(found.rms_inlier_px));
}

fn recorded(seed: u64) -> (Bench, Vec<StagePose>) {
    let mut dice = Dice::new(seed);
    let bench = Bench::built(&mut dice);
    let poses = SIX_POSES.iter().map(|&at| bench.pose(at, 12, NOISE_PX, &mut dice)).collect();
    (bench, poses)
}

#[test]
fn stage_poses_are_predicted_from_the_others_as_well_as_they_claim() {
    let (bench, poses) = recorded(5);
    let held_out = validate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    assert_eq!(held_out.len(), 6);
    for pose in &held_out {
        println!("{} {} chi square {}", pose.rotation, pose.translation, pose.chi_square);
        assert!(pose.rotation.deg() < 0.05 && pose.translation.mm() < 0.6 && pose.chi_square < 22.5);
    }
    let too_few = validate_stage(&bench.drawn, &poses[..3], &StageOptions::default());
    assert_eq!(too_few, Err(StageError::TooFewPoses(2)));
}

/// An encoder that slipped once: the calibration without that pose contradicts it.
#[test]
fn a_pose_with_a_wrong_reading_stands_out() {
    let (bench, mut poses) = recorded(6);
    poses[4].readings[0] = AxisPosition::Linear(Length::from_mm(poses[4].readings[0].value() + 1.0));
    let held_out = validate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    assert!(held_out[4].chi_square > 100.0, "{}", held_out[4].chi_square);
}
