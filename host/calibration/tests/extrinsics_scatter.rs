//! A pair is worth less where its views disagree: the scatter of their own relative poses is counted.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use simulated::{Dice, Pair, error, lens, other_lens, pair_pose};
use vergence_calibration::{ExtrinsicsCalibration, ExtrinsicsOptions, StereoView, calibrate_extrinsics};

fn pair() -> Pair {
    Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(40.0), noise_px: 0.1 }
}

fn calibrate(views: &[StereoView]) -> ExtrinsicsCalibration {
    calibrate_extrinsics(&pair().left, &pair().right, views, &ExtrinsicsOptions::default()).unwrap()
}

/// Views whose right image shows the target somewhere else: the cameras did not expose at the same instant.
fn late_views(dice: &mut Dice) -> Vec<StereoView> {
    let mut views = pair().views(12, dice);
    for view in &mut views {
        let [du, dv] = [dice.normal(), dice.normal()];
        for corner in &mut view.right.corners {
            (corner.pixel.u, corner.pixel.v) = (corner.pixel.u + du, corner.pixel.v + dv);
        }
    }
    views
}

#[test]
fn independent_noise_scatters_as_stated() {
    for seed in 0..8 {
        let found = calibrate(&pair().views(12, &mut Dice::new(seed)));
        assert!((1.0..1.3).contains(&found.view_scatter), "seed {seed}: {}", found.view_scatter);
        let growth = found.scattered_covariance.trace() / found.covariance.trace();
        assert!((growth / found.view_scatter.powi(2) - 1.0).abs() < 1e-6, "{growth}");
    }
}

/// The squared error of the pose in its standard deviations averages to 6 if they are right. A reduced chi-squared is a
/// mean over the six unknowns: the shift of whole targets acts on few of them, whose errors stay underestimated.
#[test]
fn the_scattered_covariance_comes_near_the_errors_of_views_taken_at_two_instants() {
    const SEEDS: u64 = 16;
    let [mut stated, mut scattered] = [0.0; 2];
    for seed in 0..SEEDS {
        let found = calibrate(&late_views(&mut Dice::new(100 + seed)));
        assert!(found.view_scatter > 2.0, "{}", found.view_scatter);
        let off = error(&found.joint.left_from_right, &pair().left_from_right);
        let square = |covariance: nalgebra::Matrix6<f64>| off.dot(&(covariance.try_inverse().unwrap() * off));
        stated += square(found.covariance) / SEEDS as f64;
        scattered += square(found.scattered_covariance) / SEEDS as f64;
    }
    println!("mean square: {stated:.1} as the corners say, {scattered:.1} with the scatter of the views; 6 is right");
    assert!(stated > 500.0 && (2.0..40.0).contains(&scattered));
}
