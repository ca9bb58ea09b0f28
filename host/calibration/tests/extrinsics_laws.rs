//! Laws of the joint fit: exact data, gross corners, targets beyond 90°, and refusals by name.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;
use simulated::{Dice, Pair, apart, facing_target, lens, other_lens, pair_pose};
use vergence_calibration::{
    ExtrinsicsError, ExtrinsicsOptions, LensKnowledge, PoseError, Side, StereoOutlierReason, StereoView,
    calibrate_extrinsics,
};
use vergence_targets::TargetView;
use vergence_vision::{LENS_PARAMETERS, Pixel};

fn pair(separation_deg: f64, noise_px: f64) -> Pair {
    Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(separation_deg), noise_px }
}

fn calibrate(
    pair: &Pair,
    views: &[StereoView],
) -> Result<vergence_calibration::ExtrinsicsCalibration, ExtrinsicsError> {
    calibrate_extrinsics(&pair.left, &pair.right, views, &ExtrinsicsOptions::default())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn exact_corners_give_the_exact_pose(seed in 0u64..10_000, separation in -40.0..130f64) {
        let pair = pair(separation, 0.0);
        let views = pair.views(4, &mut Dice::new(seed));
        let found = calibrate(&pair, &views).unwrap();
        let (rotation, translation) = apart(&found.joint.left_from_right, &pair.left_from_right);
        prop_assert!(rotation < 1e-7 && translation < 1e-6, "{rotation}° {translation} mm");
    }

    /// Naming the views or listing corners in another order changes nothing but rounding.
    #[test]
    fn the_order_of_corners_and_views_does_not_matter(seed in 0u64..10_000) {
        let pair = pair(60.0, 0.1);
        let views = pair.views(4, &mut Dice::new(seed));
        let mut reversed: Vec<StereoView> = views.iter().rev().cloned().collect();
        for view in &mut reversed {
            view.left.corners.reverse();
            view.right.corners.reverse();
        }
        let (a, b) = (calibrate(&pair, &views).unwrap(), calibrate(&pair, &reversed).unwrap());
        let (rotation, translation) = apart(&a.joint.left_from_right, &b.joint.left_from_right);
        prop_assert!(rotation < 1e-6 && translation < 1e-5, "{rotation}° {translation} mm");
    }
}

/// Both cameras see every target only beyond 80°, most corners beyond 90°.
#[test]
fn targets_seen_only_near_and_beyond_90_degrees() {
    let (mut dice, pair) = (Dice::new(7), pair(176.0, 0.1));
    let forward = pair.left_from_right.rotation().powf(0.5) * Vector3::z();
    let views: Vec<StereoView> = (0..40)
        .map(|index| {
            let range = dice.between(500.0, 900.0);
            let centre = pair.left_from_right.origin().mm() * 0.5 + forward * range + dice.cube(60.0);
            pair.see(format!("{index}"), &facing_target(&mut dice, centre, 40.0), &mut dice)
        })
        .filter(|view| view.left.corners.len() >= 20 && view.right.corners.len() >= 20)
        .take(12)
        .collect();
    assert_eq!(views.len(), 12);
    let beyond = views.iter().flat_map(StereoView::corners).filter(|(side, corner)| {
        let camera = if *side == Side::Left { &pair.left } else { &pair.right };
        let ray = camera.unproject::<vergence_vision::Camera>(corner.pixel).unwrap();
        assert!(ray.angle_to_axis().deg() > 75.0);
        ray.angle_to_axis().deg() > 90.0
    });
    assert!(beyond.count() > 200);
    let found = calibrate(&pair, &views).unwrap();
    let (rotation, translation) = apart(&found.joint.left_from_right, &pair.left_from_right);
    println!("{rotation:.4}° {translation:.4} mm");
    assert!(rotation < 0.02 && translation < 0.2);
}

#[test]
fn gross_corners_are_named_and_left_out() {
    let (mut dice, pair) = (Dice::new(3), pair(120.0, 0.1));
    let mut views = pair.views(8, &mut dice);
    views[2].left.corners[5].pixel.u += 4.0;
    views[6].right.corners[9].pixel.v -= 40.0;
    let found = calibrate(&pair, &views).unwrap();
    let named: Vec<_> = found.outliers.iter().map(|o| (o.view.as_str(), o.side, o.reason)).collect();
    let expected =
        [("view 3", Side::Left, StereoOutlierReason::Gross), ("view 7", Side::Right, StereoOutlierReason::Gross)];
    assert_eq!(named, expected);
    assert_eq!(found.corners_inlier, found.corners_total - 2);
    let (rotation, translation) = apart(&found.joint.left_from_right, &pair.left_from_right);
    assert!(rotation < 0.02 && translation < 0.1);
    assert!(found.rms_inlier_px < 0.16 && found.joint.rms_px > 0.5);
}

#[test]
fn a_target_counted_from_the_other_end_is_left_out_whole() {
    let (mut dice, pair) = (Dice::new(4), pair(60.0, 0.1));
    let mut views = pair.views(10, &mut dice);
    for corner in &mut views[4].right.corners {
        let [x, y] = corner.target_mm;
        corner.target_mm = [8.0 * simulated::SQUARE_MM - x, 5.0 * simulated::SQUARE_MM - y];
    }
    let found = calibrate(&pair, &views).unwrap();
    assert!(found.outliers.iter().all(|o| o.view == "view 5" && o.reason == StereoOutlierReason::ViewRejected));
    assert_eq!(found.outliers.len(), views[4].corners().count());
    let (rotation, translation) = apart(&found.joint.left_from_right, &pair.left_from_right);
    assert!(rotation < 0.02 && translation < 0.1, "{rotation}° {translation} mm");
}

/// Each camera may miss other corners; what is there is used.
#[test]
fn missing_corners_are_no_obstacle() {
    let (mut dice, pair) = (Dice::new(5), pair(120.0, 0.0));
    let mut views = pair.views(5, &mut dice);
    views[0].left.corners.truncate(20);
    views[0].right.corners.drain(..20);
    views[1].left.corners.retain(|corner| corner.target_mm[0] < 60.0);
    let found = calibrate(&pair, &views).unwrap();
    assert!(apart(&found.joint.left_from_right, &pair.left_from_right).1 < 1e-6);
}

#[test]
fn refusals_are_named() {
    let (mut dice, pair) = (Dice::new(6), pair(120.0, 0.1));
    let views = pair.views(4, &mut dice);

    assert_eq!(calibrate(&pair, &views[..2]), Err(ExtrinsicsError::TooFewViews { usable: 2 }));
    assert_eq!(calibrate(&pair, &[]), Err(ExtrinsicsError::TooFewViews { usable: 0 }));

    let lefts: Vec<TargetView> = views.iter().map(|view| view.left.clone()).collect();
    assert_eq!(StereoView::pair(&lefts, &lefts[1..]), Err(ExtrinsicsError::ViewsDoNotPair { left: 4, right: 3 }));

    let mut broken = views.clone();
    broken[1].right.corners[0].pixel.u = f64::NAN;
    let reason = PoseError::NotFinite;
    assert_eq!(
        calibrate(&pair, &broken),
        Err(ExtrinsicsError::View { view: "view 2".into(), side: Side::Right, reason })
    );

    let mut twice = views.clone();
    let first = twice[3].left.corners[0];
    twice[3].left.corners.push(first);
    let reason = PoseError::Duplicate(first.target_mm);
    assert_eq!(
        calibrate(&pair, &twice),
        Err(ExtrinsicsError::View { view: "view 4".into(), side: Side::Left, reason })
    );

    // A view in which one camera sees a single row of corners is skipped by name, not refused.
    let mut row = views.clone();
    let y = row[0].left.corners[0].target_mm[1];
    row[0].left.corners.retain(|corner| (corner.target_mm[1] - y).abs() < 1.0);
    let found = calibrate(&pair, &row).unwrap();
    assert_eq!((found.skipped[0].view.as_str(), found.skipped[0].side), ("view 1", Side::Left));
    assert_eq!(found.skipped[0].reason, PoseError::Degenerate);

    let singular = nalgebra::SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::zeros();
    let lenses = LensKnowledge::within(singular, singular);
    let options = ExtrinsicsOptions { lenses, robust: true };
    let refused = calibrate_extrinsics(&pair.left, &pair.right, &views, &options);
    assert_eq!(refused, Err(ExtrinsicsError::LensCovariance));
}

/// Parallel targets leave free lenses open.
#[test]
fn free_lenses_need_different_tilts() {
    let pair = pair(0.0, 0.0);
    let at = |x: f64| Isometry3::translation(x - 100.0, -60.0, 400.0);
    let views: Vec<StereoView> =
        [0.0, 1e-9, 2e-9].iter().map(|&x| pair.see("parallel".into(), &at(x), &mut Dice::new(1))).collect();
    let options = ExtrinsicsOptions { lenses: LensKnowledge::Free, robust: false };
    assert!(matches!(
        calibrate_extrinsics(&pair.left, &pair.right, &views, &options),
        Err(ExtrinsicsError::NotDetermined | ExtrinsicsError::Diverged)
    ));
}

/// The same arguments give the same bits.
#[test]
fn repeatable_to_the_last_bit() {
    let pair = pair(120.0, 0.1);
    let views = pair.views(5, &mut Dice::new(11));
    assert_eq!(calibrate(&pair, &views), calibrate(&pair, &views));
    let pixel: Pixel = views[0].left.corners[0].pixel;
    assert!(pixel.u.is_finite());
}
