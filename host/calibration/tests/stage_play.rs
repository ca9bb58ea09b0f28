//! Play that nobody stated: found by a calibration of the stage where it is, and not where it is not.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use rayon::prelude::*;
use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, error, seeds};
use vergence_calibration::{StageCalibration, StageOptions, StagePose, calibrate_stage};
use vergence_rig::AxisPosition;

/// Width of the play of the separation: the stage is anywhere in it. Its standard deviation is that of play which is √3 times narrower and
/// holds the stage at one of its ends, as a rig file states it.
const PLAY: f64 = 0.05_f64.to_radians();

/// Readings of a stage that lies somewhere in the play of its separation.
fn with_play(bench: &Bench, mut readings: Vec<AxisPosition>, play: f64, dice: &mut Dice) -> Vec<AxisPosition> {
    let off = play * dice.between(-0.5, 0.5);
    readings[1] = AxisPosition::from_value(bench.drawn.axes[1].kind, readings[1].value() + off);
    readings
}

/// A stage calibrated from six poses.
fn calibrated(seed: u64, play: f64) -> (Bench, StageCalibration, Dice) {
    let mut dice = Dice::new(500 + seed);
    let bench = Bench::built(&mut dice);
    let pose = |at: &[f64; 2], dice: &mut Dice| {
        let StagePose { readings, views } = bench.pose(*at, 12, 0.1, dice);
        StagePose { readings: with_play(&bench, readings, play, dice), views }
    };
    let poses: Vec<StagePose> = SIX_POSES.iter().map(|at| pose(at, &mut dice)).collect();
    let stage = calibrate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    (bench, stage, dice)
}

/// The mean of squared errors of predicted poses in units of their covariance, six on average.
fn nees(bench: &Bench, stage: &StageCalibration, dice: &mut Dice) -> f64 {
    const PREDICTED: usize = 30;
    let one = |dice: &mut Dice| {
        let at = bench.anywhere(dice);
        let predicted = stage.predict(&with_play(bench, bench.read(&at), PLAY, dice));
        let error = error(&predicted.left_from_right, &bench.left_from_right(&at));
        (error.transpose() * predicted.covariance.try_inverse().unwrap() * error)[(0, 0)]
    };
    (0..PREDICTED).map(|_| one(dice)).sum::<f64>() / PREDICTED as f64
}

#[test]
fn play_is_found_where_it_is_and_predictions_count_it() {
    let seeds = seeds(14);
    let found: Vec<(f64, f64, usize)> = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let (bench, stage, mut dice) = calibrated(seed, PLAY);
            let separation = stage.plays().into_iter().find(|(axis, _)| axis == "separation");
            let play = separation.map_or(0.0, |(_, play)| play.value());
            let (_, without, _) = calibrated(seed, 0.0);
            (play, nees(&bench, &stage, &mut dice), without.plays().len())
        })
        .collect();
    let share = |(play, ..): &(f64, f64, usize)| 3f64.sqrt() * play / PLAY;
    let told = found.iter().filter(|found| (0.4..2.5).contains(&share(found))).count();
    let mean = |of: &dyn Fn(&(f64, f64, usize)) -> f64| found.iter().map(of).sum::<f64>() / seeds as f64;
    let size = mean(&share);
    let where_told: Vec<f64> = found.iter().filter(|(play, ..)| *play > 0.0).map(|(_, nees, _)| *nees).collect();
    let nees = where_told.iter().sum::<f64>() / where_told.len() as f64;
    let mistaken: usize = found.iter().map(|(.., plays)| plays).sum();
    println!(
        "found in {told} of {seeds}, {size:.2} of its size, NEES {nees:.2} of 6 there, {:.2} in all; {mistaken} where there is none",
        mean(&|(_, nees, _)| *nees)
    );
    assert!(
        10 * told as u64 >= 9 * seeds && (0.7..1.5).contains(&size),
        "found in {told} of {seeds}, {size} of its size"
    );
    // Six poses tell a standard deviation to a third: squares in units of it are larger than six on average.
    assert!((4.0..9.0).contains(&nees), "NEES {nees}");
    assert!(10 * mistaken as u64 <= seeds, "play is found in {mistaken} of {seeds} stages that have none");
}
