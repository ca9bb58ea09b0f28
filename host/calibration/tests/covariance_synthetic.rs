//! The stated covariance of simulated lenses: honest, and not larger than needed, where noise is white.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod intrinsics_sets;
mod simulated;

use intrinsics_sets::parameters;
use nalgebra::{DMatrix, DVector, SMatrix};
use rayon::prelude::*;
use simulated::band::{nees_band, notices};
use simulated::{Dice, lens, own_views, seeds};
use vergence_calibration::{IntrinsicsCalibration, IntrinsicsOptions, calibrate_intrinsics};
use vergence_targets::TargetView;
use vergence_vision::{LENS_PARAMETERS, OpenCvFisheye};

fn calibrate(views: &[TargetView]) -> IntrinsicsCalibration {
    calibrate_intrinsics(views, lens().size(), &IntrinsicsOptions::central()).unwrap()
}

/// The square of the difference of two lenses in units of `covariance`.
fn square(a: &OpenCvFisheye, b: &OpenCvFisheye, covariance: &SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>) -> f64 {
    let off = DVector::from_row_slice(&parameters(a)) - DVector::from_row_slice(&parameters(b));
    let scale = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| 1.0 / covariance[(i, i)].sqrt()));
    let scaled = &scale * off;
    let unit = &scale * covariance.view((0, 0), (8, 8)).into_owned() * &scale;
    scaled.dot(&unit.cholesky().unwrap().solve(&scaled))
}

fn mean(values: impl Iterator<Item = f64>, count: u64) -> f64 {
    values.sum::<f64>() / count as f64
}

#[test]
fn white_noise_is_stated_as_it_is() {
    let seeds = seeds(24);
    for views in [8, 20] {
        let of_seed = |seed: u64| calibrate(&own_views(&lens(), views, 0.1, &mut Dice::new(7000 + seed)));
        let found: Vec<IntrinsicsCalibration> = (0..seeds).into_par_iter().map(of_seed).collect();
        let truth = lens().to_opencv();
        let nees = mean(found.iter().map(|lens| square(&lens.opencv, &truth, &lens.covariance)), seeds);
        let growth = |lens: &IntrinsicsCalibration| {
            let ratio = |i: usize| (lens.covariance[(i, i)] / lens.noise_covariance[(i, i)]).sqrt();
            (0..8).map(ratio).sum::<f64>() / 8.0
        };
        let growth = mean(found.iter().map(growth), seeds);
        println!("{views} views: NEES {nees:.2} of 8, standard deviations {growth:.3} times those by noise");
        let band = nees_band(8.0, seeds as f64);
        assert!(band.contains(&nees) && notices(nees, &band, 1.5), "{nees}: {band:?}");
        assert!((0.95..1.2).contains(&growth), "{growth}");
    }
}
