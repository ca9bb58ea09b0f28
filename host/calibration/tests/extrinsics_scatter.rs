//! A pair is worth less where its views disagree: the scatter of their own relative poses is counted.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use simulated::band::nees_band;
use simulated::{Dice, Pair, error, lens, other_lens, pair_pose, seeds};
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
    let mut growth = 0.0;
    for seed in 0..8 {
        let found = calibrate(&pair().views(12, &mut Dice::new(seed)));
        assert!((1.0..1.3).contains(&found.view_scatter), "seed {seed}: {}", found.view_scatter);
        let ratio = found.covariance.component_div(&found.noise_covariance).diagonal();
        growth += ratio.map(f64::sqrt).mean() / 8.0;
    }
    println!("standard deviations by the scatter of the views are {growth:.2} times those by noise");
    assert!((1.0..1.2).contains(&growth), "{growth}");
}

/// The squared error of the pose in its standard deviations averages to 6 if they are right. The shifts act on few of the six numbers,
/// and a dozen views tell only roughly on which: over many seeds the average is a fifth larger, the standard deviations a tenth too
/// small.
#[test]
fn the_covariance_is_that_of_the_errors_of_views_taken_at_two_instants() {
    let seeds = seeds(24);
    let [mut noise, mut stated] = [0.0; 2];
    for seed in 0..seeds {
        let found = calibrate(&late_views(&mut Dice::new(100 + seed)));
        assert!(found.view_scatter > 2.0, "{}", found.view_scatter);
        let off = error(&found.joint.left_from_right, &pair().left_from_right);
        let square = |covariance: nalgebra::Matrix6<f64>| off.dot(&(covariance.try_inverse().unwrap() * off));
        noise += square(found.noise_covariance) / seeds as f64;
        stated += square(found.covariance) / seeds as f64;
    }
    println!("mean square: {noise:.1} by the noise of the corners, {stated:.2} as stated; 6 is right");
    let band = nees_band(6.0, seeds as f64);
    assert!(noise > 500.0 && (band.start..1.25 * band.end).contains(&stated), "{stated}: {band:?}");
}
