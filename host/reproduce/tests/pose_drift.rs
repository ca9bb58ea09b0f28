//! Pose drift: found among wrong matches, and not reported for a pose as good as stated.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod common;

use common::{Gaussian, around, left_from_middle, left_from_right, lens, see};
use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};
use vergence_alignment::pose_drift;
use vergence_vision::{
    KannalaBrandt, LENS_PARAMETERS, Left, Pixel, PixelPair, Point, Right, StereoPair, Transform, UnitRay, ray_to_plane,
};

const PIXEL_SIGMA: f64 = 0.2;
const SEPARATION: f64 = 60.0;

/// Matches of points at 0.4 to 4 m from cameras in `true_pose`, every third wrong by up to 40 px.
fn pairs(
    lens: &KannalaBrandt,
    true_pose: Transform<Left, Right>,
    seed: u64,
    wrong_every: usize,
) -> Vec<(PixelPair, f64)> {
    let pair = StereoPair { left: lens, right: lens, left_from_right: true_pose };
    let mut gaussian = Gaussian(seed);
    let mut found = Vec::new();
    while found.len() < 300 {
        let range = 400.0 * 10f64.powf(gaussian.uniform());
        let (azimuth, elevation) = (120.0 * (gaussian.uniform() - 0.5), 140.0 * (gaussian.uniform() - 0.5));
        let point = left_from_middle(SEPARATION) * Point::from_mm(around(range, azimuth, elevation));
        let Some(exact) = see(&pair, &point) else { continue };
        let wrong = if found.len() % wrong_every == 0 { 40.0 } else { 0.0 };
        let aside = |pixel: Pixel, gaussian: &mut Gaussian| Pixel {
            u: pixel.u + wrong * (gaussian.uniform() - 0.5),
            v: pixel.v + wrong * (gaussian.uniform() - 0.5),
        };
        let right = gaussian.noisy(exact.right, PIXEL_SIGMA);
        let right = aside(right, &mut gaussian);
        found.push((PixelPair { left: gaussian.noisy(exact.left, PIXEL_SIGMA), right }, PIXEL_SIGMA));
    }
    found
}

fn stated() -> Matrix6<f64> {
    let (turn, shift) = (0.02f64.to_radians().powi(2), 0.1f64.powi(2));
    Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift))
}

#[test]
fn a_turn_of_the_right_camera_is_found_among_wrong_pairs() {
    let lens = lens(0.0);
    let nominal = left_from_right(SEPARATION);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: nominal };
    for axis in [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.6, -0.64, 0.48)] {
        for degrees in [0.3, 5.0] {
            let turn = axis * f64::to_radians(degrees);
            let turned = UnitQuaternion::from_scaled_axis(turn) * nominal.rotation();
            let truth = Transform::new(turned, nominal.origin().mm());
            let drift = pose_drift(&pairs(&lens, truth, 3, 3), &pair, &stated()).unwrap();
            assert!(drift.is_significant(), "{axis:?}: {}", drift.chi_squared);
            let error = (drift.correction.fixed_rows::<3>(0) - turn).norm().to_degrees();
            let sigma = drift.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt().to_degrees();
            assert!(error < 3.0 * sigma, "{axis:?}: off by {error:.4}°, sigma {sigma:.4}°");
            assert!((drift.angle.deg() - degrees).abs() < 0.04, "{}", drift.angle);
            assert!(drift.agreeing > 0.6 && drift.agreeing < 0.75, "{}", drift.agreeing);
        }
    }
}

/// One pose in ten thousand looks wrong by chance; of forty, none does.
#[test]
fn a_pose_as_good_as_stated_raises_no_warning() {
    let lens = lens(0.0);
    let nominal = left_from_right(SEPARATION);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: nominal };
    for seed in 0..40 {
        let mut gaussian = Gaussian(1000 + seed);
        let mut three = |sigma: f64| Vector3::new(gaussian.normal(), gaussian.normal(), gaussian.normal()) * sigma;
        let turn = UnitQuaternion::from_scaled_axis(three(0.02f64.to_radians()));
        let truth = Transform::new(turn * nominal.rotation(), nominal.origin().mm() + three(0.1));
        let drift = pose_drift(&pairs(&lens, truth, seed, 4), &pair, &stated()).unwrap();
        assert!(!drift.is_significant(), "{seed}: {} {}", drift.chi_squared, drift.angle);
    }
}

#[test]
fn few_matches_give_no_pose_drift() {
    let lens = lens(0.0);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(SEPARATION) };
    let some = pairs(&lens, pair.left_from_right, 1, 1000);
    assert_eq!(pose_drift(&some[..19], &pair, &stated()), None);
    assert_eq!(pose_drift(&some[..0], &pair, &stated()), None);
    let nowhere = vec![(PixelPair { left: Pixel { u: 1e6, v: 0.0 }, ..PixelPair::default() }, PIXEL_SIGMA); 100];
    assert_eq!(pose_drift(&nowhere, &pair, &stated()), None);
}

/// The derivative of the angle to the epipolar plane by the pose, against finite differences.
#[test]
fn the_derivative_of_the_residual_agrees_with_differences() {
    let lens = lens(0.02);
    let pose = left_from_right(SEPARATION);
    for (azimuth, elevation) in [(0.0, 0.0), (30.0, -20.0), (-50.0, 60.0)] {
        let pair = StereoPair { left: &lens, right: &lens, left_from_right: pose };
        let point = left_from_middle(SEPARATION) * Point::from_mm(around(700.0, azimuth, elevation));
        let (left, right) = (point.direction().unwrap(), (pose.inverse() * point).direction().unwrap());
        let found = vergence_vision::ResidualUncertainty::of(&left, &right, &pair, 0.1).unwrap();
        let residual = |turn: Vector3<f64>, shift: Vector3<f64>, right: &UnitRay<Right>| {
            let moved: Transform<Left, Right> =
                Transform::new(UnitQuaternion::from_scaled_axis(turn) * pose.rotation(), pose.origin().mm() + shift);
            ray_to_plane(&left, &(moved * *right), &moved.origin()).unwrap().rad()
        };
        for axis in 0..3 {
            let unit = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
            let zero = Vector3::zeros();
            let by_turn = (residual(unit * 1e-5, zero, &right) - residual(unit * -1e-5, zero, &right)) / 2e-5;
            let by_shift = (residual(zero, unit * 1e-2, &right) - residual(zero, unit * -1e-2, &right)) / 2e-2;
            assert!((found.by_shared[2 * LENS_PARAMETERS + axis] - by_turn).abs() < 1e-7, "{axis}: {by_turn}");
            assert!((found.by_shared[2 * LENS_PARAMETERS + 3 + axis] - by_shift).abs() < 1e-8, "{axis}: {by_shift}");
        }
    }
}
