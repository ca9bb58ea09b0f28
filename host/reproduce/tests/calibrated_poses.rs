//! Poses by the file of a calibrated rig, in the frames of its cameras' rays, against the truth: through lenses that are traced and mounted as badly
//! as calibrations count on, from projected corners good to 0.1 px. With small images the noise of the corners hides what a lens model lacks,
//! so that the cameras here have their full size.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use common::{count, way_to_truth};
use rayon::prelude::*;
use vergence_reproduce::{LensedRig, own_frame};
use vergence_rig::{BENCH_TOML, LensField, Rig};
use vergence_scene::LensChoice;
use vergence_vision::Side;

/// Baseline in millimetres and separation in degrees.
const POSES: [[f64; 2]; 3] = [[145.0, 0.0], [145.0, 60.0], [145.0, 120.0]];

/// The NEES of 6 at each pose.
fn trial(design: LensChoice, seed: u64) -> [f64; 3] {
    let drawn = Rig::from_toml(BENCH_TOML).expect("the bench");
    let LensedRig { lenses, file, .. } = LensedRig::mounted(&drawn, design, seed).expect("it is calibrated");
    let known = Rig::from_toml(&file.expect("a file")).expect("a rig");
    let known = known.measuring_in(LensField::Measured).expect("the lenses' errors are known");
    let turns = [Side::Left, Side::Right].map(|side| own_frame(known.camera(side), &lenses[side.index()]));
    POSES.map(|[baseline, separation]| {
        let values = [baseline, separation.to_radians()];
        let (stated, truth) = (known.pose_at_values(&values), drawn.pose_at_values(&values));
        let way = way_to_truth(&stated.left_from_right, &truth.left_from_right, turns);
        way.dot(&stated.covariance().cholesky().expect("a covariance").solve(&way))
    })
}

fn check(design: &str, seeds: u64) {
    let lens: LensChoice = design.parse().expect("a design");
    let all: Vec<[f64; 3]> = (1..=seeds).into_par_iter().map(|seed| trial(lens, seed)).collect();
    // The sum of six squares has a variance of twelve.
    let band = 1.96 * (12.0 / seeds as f64).sqrt();
    for (pose, [baseline, separation]) in POSES.iter().enumerate() {
        let nees = all.iter().map(|of| of[pose]).sum::<f64>() / seeds as f64;
        println!("{design}, {baseline} mm, {separation}°, {seeds} rigs: NEES {nees:.2} of 6 ± {band:.2}");
        assert!((nees - 6.0).abs() < band, "{design}, {separation}°: {nees} is not within 6 ± {band}");
    }
}

#[test]
fn poses_through_a_mounted_sigma_lens_are_as_uncertain_as_the_file_states() {
    check("sigma8_f18", u64::from(count("VERGENCE_SEEDS", 12)));
}

#[test]
fn poses_through_a_mounted_nikkor_are_as_uncertain_as_the_file_states() {
    check("nikkor6_f28", u64::from(count("VERGENCE_SEEDS", 12)));
}
