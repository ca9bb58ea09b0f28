//! Points and covariances of whole arrays agree with the single-point functions.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{SMatrix, UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, BatchPair, BatchPoints, CENTRAL_PARAMETERS, ImageSize, Instructions, KannalaBrandt, LENS_PARAMETERS, Left,
    OpenCvFisheye, PointUncertainty, Right, SHARED_PARAMETERS, SharedCovariance, StereoPair, Transform, UnitRay,
    pseudo_intersection,
};

const PIXEL_SIGMA: f64 = 0.3;
/// Standard deviations of both lenses, which are central, and the pose, about those of a calibration.
const LENS_SIGMAS: [f64; CENTRAL_PARAMETERS] = [0.05, 0.05, 0.04, 0.04, 2e-4, 3e-4, 2e-4, 5e-5];
const POSE_SIGMAS: [f64; 6] = [2e-4, 2e-4, 2e-4, 0.05, 0.05, 0.05];

fn sigma(parameter: usize) -> f64 {
    let of_lens = || LENS_SIGMAS.get(parameter % LENS_PARAMETERS).copied().unwrap_or(0.0);
    parameter.checked_sub(2 * LENS_PARAMETERS).map_or_else(of_lens, |pose| POSE_SIGMAS[pose])
}

fn lens(fx: f64, fy: f64, k: [f64; 4]) -> KannalaBrandt {
    let camera = OpenCvFisheye { fx, fy, cx: 1039.5, cy: 1031.5, k };
    KannalaBrandt::from_opencv(camera, Angle::from_deg(99.0), ImageSize { width: 2080, height: 2080 }).unwrap()
}

/// A covariance in which every parameter is correlated with all others.
fn shared(mixing: &[f64]) -> SharedCovariance {
    let mixed = SMatrix::<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>::from_fn(|row, column| {
        sigma(row) * if row == column { 1.0 } else { 0.3 * mixing[(row * 7 + column * 3) % mixing.len()] }
    });
    SharedCovariance::joint(mixed * mixed.transpose())
}

/// The result of the single-point functions; `None` where they refuse.
fn expected(
    rays: [&[f64; 3]; 2],
    pair: &StereoPair<'_>,
    shared: &SharedCovariance,
) -> Option<(Vector3<f64>, nalgebra::Matrix3<f64>)> {
    let left = UnitRay::<Left>::new(Vector3::from(*rays[0]))?;
    let right = pair.left_from_right * UnitRay::<Right>::new(Vector3::from(*rays[1]))?;
    let point = pseudo_intersection(&left, &right, &pair.left_from_right.origin()).ok()?.point;
    Some((point.mm(), PointUncertainty::of(&point, pair, PIXEL_SIGMA)?.covariance(shared)))
}

proptest! {
    #[test]
    fn points_and_covariances_agree_with_the_single_point_functions(
        rows in prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -0.1..1.0, 100.0..3000.0, -1.0..1.0, -1.0..1.0], 1..150),
        mixing in prop::array::uniform11(-1.0..1.0f64),
        turn in [-0.3..0.3f64, -1.1..1.1, -0.3..0.3],
        t in [80.0..200.0f64, -30.0..30.0, -60.0..60.0],
    ) {
        let lenses = [lens(560.0, 571.0, [0.01, -0.004, 0.001, -0.0002]), lens(610.0, 598.0, [-0.02, 0.002, 0.0, 0.0])];
        let left_from_right = Transform::<Left, Right>::new(UnitQuaternion::from_scaled_axis(turn.into()), t.into());
        let pair = StereoPair { left: &lenses[0], right: &lenses[1], left_from_right };
        let shared = shared(&mixing);
        // Rays that miss each other by up to a millimetre; every fifth pair is unrelated.
        let (left, right): (Vec<[f64; 3]>, Vec<[f64; 3]>) = rows.iter().enumerate().map(|(i, &[x, y, z, range, a, b])| {
            let ray = Vector3::new(x, y, z).normalize();
            let meeting = ray * range - Vector3::from(t) + Vector3::new(a, b, 0.5);
            let right = if i % 5 == 4 { Vector3::new(a, b, 0.5) } else { left_from_right.rotation().inverse() * meeting };
            (<[f64; 3]>::from(ray), <[f64; 3]>::from(right.normalize()))
        }).unzip();
        for instructions in [Instructions::Best, Instructions::Baseline] {
            let batch = BatchPair::new(&pair, PIXEL_SIGMA, &shared).with_instructions(instructions);
            let found = batch.triangulate(&left, &right);
            prop_assert_eq!(found.points.len(), left.len());
            prop_assert_eq!(found.covariances.len(), left.len());
            for (row, (point, &[xx, xy, xz, yy, yz, zz])) in found.points.iter().zip(&found.covariances).enumerate() {
                let rays = [&left[row], &right[row]];
                let crossing = Vector3::from(left[row]).cross(&(left_from_right.rotation() * Vector3::from(right[row])));
                // Where a condition is nearly met, rounding decides.
                let close_call = crossing.norm() < 1e-3;
                match expected(rays, &pair, &shared) {
                    Some((place, covariance)) if !close_call => {
                        prop_assert!((Vector3::from(*point) - place).norm() < 1e-8 * place.norm());
                        let full = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                        let off = (full - covariance).amax();
                        prop_assert!(off < 1e-6 * covariance.trace(), "{} {}", full, covariance);
                    }
                    Some(_) => {}
                    None => prop_assert!(close_call || point.iter().chain(&found.covariances[row]).all(|x| x.is_nan())),
                }
            }
        }
    }
}

#[test]
fn a_ray_along_the_axis_has_a_covariance_too() {
    let lens = lens(560.0, 560.0, [0.0; 4]);
    let left_from_right = Transform::<Left, Right>::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0));
    let pair = StereoPair { left: &lens, right: &lens, left_from_right };
    let shared = shared(&[0.5]);
    let rays = [[0.0, 0.0, 1.0], Vector3::new(-145.0, 0.0, 400.0).normalize().into()];
    let found = BatchPair::new(&pair, PIXEL_SIGMA, &shared).triangulate(&rays[..1], &rays[1..]);
    let (_, covariance) = expected([&rays[0], &rays[1]], &pair, &shared).unwrap();
    assert!((found.covariances[0][0] - covariance[(0, 0)]).abs() < 1e-9 * covariance.trace());
    assert!((found.covariances[0][5] - covariance[(2, 2)]).abs() < 1e-9 * covariance.trace());
}

/// The covariance of a lens from 4000 pixels within 60° of the axis, each known to 0.1 px. The distortion coefficients are
/// correlated almost entirely, and towards 95° their errors are large and cancel each other.
fn calibrated(lens: &KannalaBrandt) -> SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS> {
    let mut information = SMatrix::<f64, 8, 8>::zeros();
    for i in 0..4000 {
        let (theta, phi) = (60f64.to_radians() * f64::from(i) / 4000.0, 2.4 * f64::from(i));
        let ray = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let by_lens = lens.pixel_by_lens(&UnitRay::<Left>::new(ray).unwrap()).fixed_columns::<8>(0).into_owned();
        information += by_lens.transpose() * by_lens / 0.01;
    }
    let mut covariance = SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::zeros();
    covariance.fixed_view_mut::<8, 8>(0, 0).copy_from(&information.try_inverse().unwrap());
    covariance
}

#[test]
fn the_strong_correlations_of_a_calibration_cost_no_digits() {
    let lenses = [lens(560.0, 571.0, [0.01, -0.004, 0.001, -0.0002]), lens(610.0, 598.0, [-0.02, 0.002, 0.0, 0.0])];
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, 0.5, -0.03));
    let left_from_right = Transform::<Left, Right>::new(turn, Vector3::new(140.0, 3.0, 30.0));
    let pair = StereoPair { left: &lenses[0], right: &lenses[1], left_from_right };
    let [left_lens, right_lens] = [calibrated(&lenses[0]), calibrated(&lenses[1])];
    let pose = nalgebra::Matrix6::from_diagonal(&[1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e-4].into());
    let shared = SharedCovariance::exact().with_lenses([&left_lens, &right_lens]).with_pose(&pose);
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for i in 0..1000 {
        let (theta, phi) = (97f64.to_radians() * f64::from(i) / 1000.0, 2.4 * f64::from(i));
        let point = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * 1000.0;
        let in_right = (turn.inverse() * (point - left_from_right.origin().mm())).normalize();
        if in_right.z > 98f64.to_radians().cos() {
            left.push(point.normalize().into());
            right.push(in_right.into());
        }
    }
    let mut found = BatchPair::new(&pair, PIXEL_SIGMA, &shared).triangulate(&left, &right);
    let mut seen = 0;
    for (row, &[xx, xy, xz, yy, yz, zz]) in found.covariances.iter().enumerate() {
        let Some((_, covariance)) = expected([&left[row], &right[row]], &pair, &shared) else { continue };
        let off = (nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - covariance).amax();
        assert!(off < 1e-8 * covariance.trace(), "row {row}: {off} of {covariance}");
        seen += 1;
    }
    assert!(seen > 600 && seen + 20 > left.len(), "{seen} of {}", left.len());

    // Into the same memory once more.
    let first = found.clone();
    let memory = found.covariances.as_ptr();
    found.clear();
    BatchPair::new(&pair, PIXEL_SIGMA, &shared).triangulate_into(&left[..301], &right, &mut found);
    assert_eq!((found.covariances.len(), found.covariances.as_ptr()), (301, memory));
    BatchPair::new(&pair, PIXEL_SIGMA, &shared).triangulate_into(&left[301..], &right[301..], &mut found);
    let bits = |points: &BatchPoints| {
        let bits = |c: &f64| if c.is_nan() { 0 } else { c.to_bits() };
        points.covariances.iter().flatten().map(bits).collect::<Vec<_>>()
    };
    assert_eq!(bits(&found), bits(&first));
}
