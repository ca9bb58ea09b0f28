//! The pose from joints and images: as uncertain as stated, in every direction, and for the points that it makes.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod common;

use common::{Gaussian, around, left_from_middle, left_from_right, lens, see};
use nalgebra::{Matrix3, Matrix6, SMatrix, UnitQuaternion, Vector3, Vector6};
use vergence_alignment::{FusedPose, MatchErrors, fuse_pose};
use vergence_vision::{
    KannalaBrandt, Left, Pixel, PixelPair, Point, PointUncertainty, Right, SharedCovariance, StereoPair, Transform,
    pseudo_intersection,
};

const PIXEL_SIGMA: f64 = 0.2;
/// The separation of gecko.
const SEPARATION: f64 = 120.0;
const TRIALS: u64 = 50;

/// Covariance of a pose by joints near a dead centre: a turn in the trunk's plane by some degrees that shifts the camera as well,
/// and small errors of all else.
fn by_joints() -> Matrix6<f64> {
    let mut spread = SMatrix::<f64, 6, 8>::zeros();
    spread[(1, 0)] = 3f64.to_radians();
    spread[(3, 0)] = 2.0;
    spread[(5, 0)] = 4.0;
    spread[(5, 1)] = 1.5;
    for component in 0..6 {
        spread[(component, component + 2)] = if component < 3 { 0.05f64.to_radians() } else { 0.2 };
    }
    spread * spread.transpose()
}

fn normal(gaussian: &mut Gaussian, covariance: &Matrix6<f64>) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| gaussian.normal())
}

fn moved(pose: &Transform<Left, Right>, by: &Vector6<f64>) -> Transform<Left, Right> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(by[0], by[1], by[2]));
    Transform::new(turn * pose.rotation(), pose.origin().mm() + by.fixed_rows::<3>(3))
}

/// The error of a pose: the turn and the shift from it to the truth.
fn error(pose: &Transform<Left, Right>, truth: &Transform<Left, Right>) -> Vector6<f64> {
    let turn = (truth.rotation() * pose.rotation().inverse()).scaled_axis();
    let shift = truth.origin().mm() - pose.origin().mm();
    Vector6::from_iterator(turn.iter().chain(shift.iter()).copied())
}

fn nees(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().unwrap().solve(error))
}

/// A point that both cameras see, and a noisy measurement of it.
fn seen(pair: &StereoPair<'_>, gaussian: &mut Gaussian) -> (Point<Left>, PixelPair) {
    loop {
        let range = 300.0 * 8f64.powf(gaussian.uniform());
        let (azimuth, elevation) = (70.0 * (gaussian.uniform() - 0.5), 140.0 * (gaussian.uniform() - 0.5));
        let point = left_from_middle(SEPARATION) * Point::from_mm(around(range, azimuth, elevation));
        if let Some(exact) = see(pair, &point) {
            let [left, right] = [exact.left, exact.right].map(|pixel| gaussian.noisy(pixel, PIXEL_SIGMA));
            // Noise may put a pixel beyond the lens's field.
            if pair.left.unproject::<Left>(left).is_ok() && pair.right.unproject::<Right>(right).is_ok() {
                return (point, PixelPair { left, right });
            }
        }
    }
}

/// Matches of cameras in the pose `truth`; one of `wrong_every` is wrong by up to 40 px.
fn matches(
    lens: &KannalaBrandt,
    truth: Transform<Left, Right>,
    seed: u64,
    wrong_every: usize,
) -> Vec<(PixelPair, f64)> {
    let pair = StereoPair { left: lens, right: lens, left_from_right: truth };
    let mut gaussian = Gaussian(seed);
    let mut measured = |number: usize| {
        let (_, mut pixels) = seen(&pair, &mut gaussian);
        if number.is_multiple_of(wrong_every) {
            let mut aside = || 80.0 * (gaussian.uniform() - 0.5);
            pixels.right = Pixel { u: pixels.right.u + aside(), v: pixels.right.v + aside() };
        }
        (pixels, PIXEL_SIGMA)
    };
    (0..250).map(&mut measured).collect()
}

/// The pose by joints, one of the true poses that it may stand for, and the pose found with matches of it.
fn trial(lens: &KannalaBrandt, seed: u64, wrong_every: usize) -> (Transform<Left, Right>, FusedPose) {
    let stated = left_from_right(SEPARATION);
    let truth = moved(&stated, &normal(&mut Gaussian(7_000 + seed), &by_joints()));
    let pair = StereoPair { left: lens, right: lens, left_from_right: stated };
    let found =
        fuse_pose(&matches(lens, truth, seed, wrong_every), &pair, &by_joints(), MatchErrors::Measured).unwrap();
    (truth, found)
}

/// A mean of `TRIALS` values of χ² with `freedom` degrees lies within this of `freedom` in 95 of 100 cases.
fn band(freedom: f64) -> f64 {
    1.96 * (2.0 * freedom / TRIALS as f64).sqrt()
}

#[test]
fn the_pose_is_as_uncertain_as_stated() {
    let lens = lens(0.0);
    for wrong_every in [1000, 4] {
        let (mut of_pose, mut told) = (0.0, 0.0);
        for seed in 0..TRIALS {
            let (truth, found) = trial(&lens, seed, wrong_every);
            of_pose += nees(&error(&found.left_from_right, &truth), &found.covariance) / TRIALS as f64;
            told += found.told_by_images / TRIALS as f64;
            assert!(found.rotation_sigma().deg() < 0.1, "{}", found.rotation_sigma());
        }
        println!("one of {wrong_every} wrong: NEES of the pose {of_pose:.2} of 6, told by the images {told:.2} of 6");
        assert!((of_pose - 6.0).abs() < band(6.0), "{of_pose}");
        // Rotation in full, and the direction of the baseline; its length is told by the joints.
        assert!(told > 4.0 && told < 5.2, "{told}");
    }
}

#[test]
fn points_by_that_pose_are_as_uncertain_as_stated() {
    let lens = lens(0.0);
    let (mut of_points, mut by_joints_alone) = (0f64, Vec::new());
    let mut fused = Vec::new();
    for seed in 0..TRIALS {
        let (truth, found) = trial(&lens, seed, 4);
        let true_pair = StereoPair { left: &lens, right: &lens, left_from_right: truth };
        let (point, pixels) = seen(&true_pair, &mut Gaussian(9_000 + seed));
        let measured = |pose: Transform<Left, Right>| {
            let pair = StereoPair { left_from_right: pose, ..true_pair };
            let rays = [
                pair.left.unproject::<Left>(pixels.left).unwrap(),
                (pose * pair.right.unproject::<Right>(pixels.right).unwrap()),
            ];
            (pair, pseudo_intersection(&rays[0], &rays[1], &pose.origin()))
        };
        let (pair, found_point) = measured(found.left_from_right);
        let found_point = found_point.unwrap().point;
        let shared = SharedCovariance::exact().with_pose(&found.covariance);
        let covariance: Matrix3<f64> =
            PointUncertainty::of(&found_point, &pair, PIXEL_SIGMA).unwrap().covariance(&shared);
        let off = found_point.mm() - point.mm();
        of_points += off.dot(&covariance.cholesky().unwrap().solve(&off)) / TRIALS as f64;
        fused.push(off.norm() / point.mm().norm());
        let alone = measured(left_from_right(SEPARATION)).1;
        by_joints_alone
            .push(alone.map_or(f64::INFINITY, |alone| (alone.point.mm() - point.mm()).norm() / point.mm().norm()));
    }
    let median = |errors: &mut Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let [fused, alone] = [median(&mut fused), median(&mut by_joints_alone)];
    println!(
        "NEES of points {of_points:.2} of 3; median error {fused:.4} of the range, by the joints alone {alone:.4}"
    );
    assert!((of_points - 3.0).abs() < band(3.0), "{of_points}");
    assert!(fused < 0.02 && alone > 3.0 * fused, "{fused} {alone}");
}

/// Where the joints tell the pose far better than the images, it stays.
#[test]
fn a_pose_that_the_joints_tell_exactly_stays() {
    let lens = lens(0.0);
    let stated = left_from_right(SEPARATION);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: stated };
    let pixels = matches(&lens, stated, 3, 4);
    let found = fuse_pose(&pixels, &pair, &Matrix6::zeros(), MatchErrors::Measured).unwrap();
    assert!(error(&found.left_from_right, &stated).norm() < 1e-12 && found.told_by_images.abs() < 1e-12, "{found:?}");
    let turn = 1e-7;
    let found = fuse_pose(&pixels, &pair, &(Matrix6::identity() * turn * turn), MatchErrors::Measured).unwrap();
    assert!(found.told_by_images < 0.05, "{}", found.told_by_images);
}

/// A bench whose angle encoder died: the pose is known but for one turn.
#[test]
fn one_dead_encoder_is_replaced_by_the_images() {
    let lens = lens(0.0);
    let stated = left_from_right(SEPARATION);
    let mut covariance = Matrix6::identity() * 1e-10;
    covariance[(1, 1)] = 10f64.to_radians().powi(2);
    let truth = moved(&stated, &Vector6::new(0.0, 8f64.to_radians(), 0.0, 0.0, 0.0, 0.0));
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: stated };
    let found = fuse_pose(&matches(&lens, truth, 5, 4), &pair, &covariance, MatchErrors::Measured).unwrap();
    let off = error(&found.left_from_right, &truth);
    let sigma = found.rotation_sigma();
    assert!(sigma.deg() < 0.02 && off.fixed_rows::<3>(0).norm() < 3.0 * sigma.rad(), "{off} {sigma}");
    assert!((found.told_by_images - 1.0).abs() < 0.2, "one component: {}", found.told_by_images);
}

#[test]
fn matches_that_agree_on_nothing_give_no_pose() {
    let lens = lens(0.0);
    let stated = left_from_right(SEPARATION);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: stated };
    let few = matches(&lens, stated, 1, 1000);
    assert_eq!(fuse_pose(&few[..19], &pair, &by_joints(), MatchErrors::Measured), None);
    assert_eq!(fuse_pose(&few[..0], &pair, &by_joints(), MatchErrors::Measured), None);
}
