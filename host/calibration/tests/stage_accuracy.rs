//! The calibrated stage at poses it never saw: how accurate, and whether the covariance says so.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use rayon::prelude::*;
use simulated::band::{nees_band, notices};
use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, apart, error, own_views, seeds};
use vergence_calibration::{
    IntrinsicsOptions, LensKnowledge, StageOptions, StagePose, calibrate_intrinsics, calibrate_stage,
};
use vergence_rig::Rig;
use vergence_vision::ImageSize;

/// The least number of seeds whose band notices standard deviations that are 1.5 times as large or as small as stated.
const FEWEST_SEEDS: u64 = 14;
/// The 95 % quantile of χ² with 6 degrees of freedom.
const CHI_SQUARE_95: f64 = 12.592;

#[derive(Default)]
struct Tally {
    rotation_squares: f64,
    translation_squares: f64,
    nees: f64,
    covered: u32,
    poses: u32,
}

impl Tally {
    fn rms(&self) -> (f64, f64) {
        let poses = f64::from(self.poses);
        ((self.rotation_squares / poses).sqrt(), (self.translation_squares / poses).sqrt())
    }

    fn coverage(&self) -> f64 {
        f64::from(self.covered) / f64::from(self.poses)
    }
}

/// Seeds are independent of each other and are run side by side; their tallies are summed in order.
fn study(stage_poses: &[[f64; 2]], own: Option<&IntrinsicsOptions>, first_seed: u64, seeds: u64) -> Tally {
    let tallies: Vec<Tally> =
        (first_seed..first_seed + seeds).into_par_iter().map(|seed| study_of(stage_poses, own, seed)).collect();
    tallies.iter().fold(Tally::default(), |sum, tally| Tally {
        rotation_squares: sum.rotation_squares + tally.rotation_squares,
        translation_squares: sum.translation_squares + tally.translation_squares,
        nees: sum.nees + tally.nees,
        covered: sum.covered + tally.covered,
        poses: sum.poses + tally.poses,
    })
}

fn study_of(stage_poses: &[[f64; 2]], own: Option<&IntrinsicsOptions>, seed: u64) -> Tally {
    let mut tally = Tally::default();
    let mut dice = Dice::new(seed);
    let bench = Bench::built(&mut dice);
    let poses: Vec<StagePose> = stage_poses.iter().map(|&at| bench.pose(at, 12, 0.1, &mut dice)).collect();
    let exact = || (bench.drawn.clone(), LensKnowledge::Exact);
    let (rig, lenses) = own.map_or_else(exact, |options| own_lenses(&bench, options, &mut dice));
    let options = StageOptions { lenses, ..StageOptions::default() };
    let stage = calibrate_stage(&rig, &poses, &options).unwrap();
    for _ in 0..30 {
        let at = bench.anywhere(&mut dice);
        let (predicted, truth) = (stage.predict(&bench.read(&at)), bench.left_from_right(&at));
        let (rotation, translation) = apart(&predicted.left_from_right, &truth);
        let error = error(&predicted.left_from_right, &truth);
        let square = (error.transpose() * predicted.covariance.try_inverse().unwrap() * error)[(0, 0)];
        tally.rotation_squares += rotation * rotation;
        tally.translation_squares += translation * translation;
        tally.nees += square;
        tally.covered += u32::from(square <= CHI_SQUARE_95);
        tally.poses += 1;
    }
    tally
}

fn own_lenses(bench: &Bench, options: &IntrinsicsOptions, dice: &mut Dice) -> (Rig, LensKnowledge) {
    let size = ImageSize { width: 2048, height: 2048 };
    let [left, right] = [0, 1].map(|side| {
        let views = own_views(&bench.lenses[side], 30, 0.1, dice);
        calibrate_intrinsics(&views, size, options).unwrap()
    });
    let rig = Rig { left_camera: left.camera, right_camera: right.camera, ..bench.drawn.clone() };
    (rig, LensKnowledge::within(left.covariance, right.covariance))
}

/// The 30 poses of one seed err together, wholly so at worst: its mean NEES counts as one draw of a χ² variable with six degrees of
/// freedom. With the default number of seeds the band is narrow enough that no mean inside it would stay inside if the standard
/// deviations were 1.5 times as large or as small.
fn assert_honest(tally: &Tally, seeds: u64) {
    let (nees, band) = (tally.nees / f64::from(tally.poses), nees_band(6.0, seeds as f64));
    assert!(band.contains(&nees), "mean NEES {nees:.2} is not in {band:.2?}");
    assert!(notices(nees, &band, 1.5), "the band {band:.2?} would not notice sigmas 1.5 times as large or as small");
}

/// As [`assert_honest`], but errors may be stated too large: these lenses have no decentring and no thin prism, which their views leave open, and
/// which count as in lenses that have some (`calibration_files` of the whole draws those).
fn assert_covered(tally: &Tally, seeds: u64) {
    let (nees, band) = (tally.nees / f64::from(tally.poses), nees_band(6.0, seeds as f64));
    assert!(nees < band.end, "mean NEES {nees:.2} is above {band:.2?}");
}

fn summary(what: &str, tally: &Tally) -> (f64, f64) {
    let (rotation, translation) = tally.rms();
    let nees = tally.nees / f64::from(tally.poses);
    println!("{what}: {rotation:.5}° {translation:.4} mm rms, coverage {:.3}, mean NEES {nees:.2}", tally.coverage());
    (rotation, translation)
}

#[test]
fn six_poses_predict_the_whole_range() {
    let seeds = seeds(FEWEST_SEEDS);
    let (central, by_evidence) = (IntrinsicsOptions::central(), IntrinsicsOptions::default());
    let honest: fn(&Tally, u64) = assert_honest;
    for (what, own, degrees, judge) in [
        ("exact lenses", None, 0.02, honest),
        ("lenses of their own calibration, known to be central", Some(&central), 0.02, honest),
        // Decentring and thin prism that 30 views leave open turn the optical axes.
        ("lenses of their own calibration", Some(&by_evidence), 0.03, assert_covered),
    ] {
        let tally = study(&SIX_POSES, own, 100, seeds);
        let (rotation, translation) = summary(what, &tally);
        assert!(rotation <= degrees && translation <= 0.1);
        judge(&tally, seeds);
    }
}

/// Three poses leave two combinations of the bench's unknowns to the drawing; what is predicted is less exact, and the
/// covariance knows.
#[test]
fn three_poses_suffice() {
    let seeds = seeds(FEWEST_SEEDS);
    let tally = study(&[[60.0, 0.0], [220.0, 1.1], [100.0, 2.27]], None, 300, seeds);
    let (rotation, translation) = summary("three poses", &tally);
    assert!(rotation <= 0.02 && translation <= 1.0);
    assert_honest(&tally, seeds);
}
