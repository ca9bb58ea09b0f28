//! Cameras that do not return to where the axes put them, which no encoder sees: a calibration of the stage finds how far where it is so, and
//! not where it is not.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use rayon::prelude::*;
use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, error, seeds};
use vergence_calibration::{StageCalibration, StageOptions, StagePose, calibrate_stage};

/// Standard deviation of each component of a return: 0.05° and 0.05 mm.
const RETURNS: [f64; 2] = [0.05_f64.to_radians(), 0.05];

/// A stage calibrated from six poses.
fn calibrated(seed: u64, returns: Option<[f64; 2]>) -> (Bench, StageCalibration, Dice) {
    let mut dice = Dice::new(900 + seed);
    let bench = Bench { returns, ..Bench::built(&mut dice) };
    let poses: Vec<StagePose> = SIX_POSES.iter().map(|at| bench.pose(*at, 12, 0.1, &mut dice)).collect();
    let stage = calibrate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    (bench, stage, dice)
}

/// The means of squared errors of poses to which the stage returns, in units of the predicted covariance, six on average, and of that
/// without the part of returns.
fn nees(bench: &Bench, stage: &StageCalibration, dice: &mut Dice) -> [f64; 2] {
    const PREDICTED: usize = 30;
    let mut sums = [0.0; 2];
    for _ in 0..PREDICTED {
        let at = bench.anywhere(dice);
        let predicted = stage.predict(&bench.read(&at));
        let error = error(&predicted.left_from_right, &bench.returned(&at, dice));
        let of_returns = stage.repeatability.map_or_else(nalgebra::Matrix6::zeros, |found| found.covariance());
        for (sum, less) in sums.iter_mut().zip([0.0, 1.0]) {
            let covariance = predicted.covariance - of_returns * less;
            *sum += (error.transpose() * covariance.try_inverse().unwrap() * error)[(0, 0)] / PREDICTED as f64;
        }
    }
    sums
}

/// What became of one seed.
struct Trial {
    /// Sizes found of turn and shift, in units of the true ones.
    sizes: [f64; 2],
    nees: [f64; 2],
    /// Whether returns are found in a stage that has none.
    mistaken: bool,
}

impl Trial {
    fn new(seed: u64) -> Self {
        let (bench, stage, mut dice) = calibrated(seed, Some(RETURNS));
        let sizes = stage
            .repeatability
            .map_or([0.0; 2], |found| [found.rotation.rad() / RETURNS[0], found.translation.mm() / RETURNS[1]]);
        let mistaken = calibrated(seed, None).1.repeatability.is_some();
        Self { sizes, nees: nees(&bench, &stage, &mut dice), mistaken }
    }
}

#[test]
fn returns_are_found_where_they_are_and_predictions_count_them() {
    let trials: Vec<Trial> = (0..seeds(8)).into_par_iter().map(Trial::new).collect();
    let seeds = trials.len();
    let mean = |of: &dyn Fn(&Trial) -> f64| trials.iter().map(of).sum::<f64>() / seeds as f64;
    let sizes = [0, 1].map(|part| mean(&|trial| trial.sizes[part]));
    let [nees, without] = [0, 1].map(|part| mean(&|trial| trial.nees[part]));
    let told = trials.iter().filter(|trial| trial.sizes.iter().all(|size| (0.3..2.5).contains(size))).count();
    let mistaken = trials.iter().filter(|trial| trial.mistaken).count();
    println!(
        "found in {told} of {seeds}, {sizes:.2?} of their size, NEES {nees:.2} of 6, {without:.0} without them; {mistaken} where there are none"
    );
    assert!(10 * told >= 9 * seeds && sizes.iter().all(|size| (0.7..1.5).contains(size)), "{told}, {sizes:?}");
    // Six poses tell both to a fifth or so.
    assert!((4.0..8.5).contains(&nees) && without > 2.0 * nees, "NEES {nees}, {without} without returns");
    assert!(10 * mistaken <= seeds, "found in {mistaken} of {seeds} stages that return");
}
