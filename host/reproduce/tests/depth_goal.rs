//! Predicted depth errors against sampled ones, and the pose that meets a goal against a fine grid.

#![allow(clippy::expect_used, reason = "a test fails loudly")]
#![allow(clippy::print_stdout, reason = "tests show their figures")]

use nalgebra::{UnitQuaternion, Vector3};
use vergence_reproduce::study::Gaussian;
use vergence_rig::{BENCH_TOML, DepthField, DepthGoal, DepthSigma, Rig, RigCalibration};
use vergence_vision::{Angle, Kernel, Left, Length, PixelPair, Point, Right, StereoPair, Transform};

const PIXEL_SIGMA: f64 = 0.1;

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench is a rig")
}

fn level() -> Angle {
    Angle::from_rad(0.0)
}

fn pose(baseline: f64, separation: f64) -> [f64; 2] {
    [baseline, separation.to_radians()]
}

#[test]
fn goals_are_parsed_and_printed() {
    let goal: DepthGoal = "sigma_z <= 1mm at 350mm over +-40deg".parse().expect("a goal");
    assert_eq!(goal.sigma, DepthSigma::Forward);
    assert!((goal.limit.mm() - 1.0).abs() < 1e-12 && (goal.range.mm() - 350.0).abs() < 1e-9);
    assert!((goal.half_width.deg() - 40.0).abs() < 1e-12);
    let again: DepthGoal = "sigma_range<=0.5 mm at 0.4m over ±1rad".parse().expect("a goal");
    assert_eq!(again.sigma, DepthSigma::Range);
    assert!((again.half_width.rad() - 1.0).abs() < 1e-12);
    let printed: DepthGoal = "sigma_z<=0.3mm at 35cm over +-30deg".parse().expect("a goal");
    assert_eq!(printed.to_string(), "sigma_z <= 0.3 mm at 350 mm over ±30°");
    for bad in [
        "",
        "sigma_z < 1mm at 350mm over +-40deg",
        "sigma_x <= 1mm at 350mm over +-40deg",
        "sigma_z <= 1 at 350mm over +-40deg",
        "sigma_z <= -1mm at 350mm over +-40deg",
        "sigma_z <= 1mm at 350mm over 40deg",
        "sigma_z <= 1mm at 350mm over +-200deg",
        "sigma_z <= 1mm over +-40deg at 350mm",
    ] {
        let error = bad.parse::<DepthGoal>().expect_err(bad);
        assert!(error.to_string().contains("sigma_z <= 1mm at 350mm over +-40deg"), "{error}");
    }
}

/// Sampled errors of the forward coordinate and the range, from matches, calibration and encoders.
fn sampled(rig: &Rig, values: &[f64; 2], azimuth: f64, range: f64, samples: u32) -> Option<[f64; 2]> {
    let field = DepthField::new(rig, values, PIXEL_SIGMA);
    let predicted = field.at(Angle::from_deg(azimuth), level(), Length::from_mm(range))?;
    let nominal = field.pose();
    let middle = field.middle().mm();
    let mut gaussian = Gaussian(11);
    let mut squares = [0.0; 2];
    for _ in 0..samples {
        // The encoders report `values`; the axes stand within a count of them, and the calibration has an error.
        let true_values: Vec<f64> = rig
            .axes
            .iter()
            .zip(values)
            .map(|(axis, value)| value + (gaussian.uniform() - 0.5) * axis.value_per_count())
            .collect();
        let exact = rig.pose_at_values(&true_values).left_from_right;
        let RigCalibration::Sigmas { rotation, translation } = &rig.calibration else { return None };
        let (turn, shift) = (rotation.rad(), translation.mm());
        let mut three = |sigma: f64| Vector3::new(gaussian.normal(), gaussian.normal(), gaussian.normal()) * sigma;
        let truth: Transform<Left, Right> = Transform::new(
            UnitQuaternion::from_scaled_axis(three(turn)) * exact.rotation(),
            exact.origin().mm() + three(shift),
        );
        let seen = PixelPair {
            left: gaussian.noisy(rig.left_camera.project_point(&predicted.point).ok()?, PIXEL_SIGMA),
            right: gaussian
                .noisy(rig.right_camera.project_point(&(truth.inverse() * predicted.point)).ok()?, PIXEL_SIGMA),
        };
        let pair =
            StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: nominal.left_from_right };
        let found = Kernel::PseudoIntersection.triangulate(&seen, &pair).ok()?.point;
        let in_base = |point: Point<Left>| (nominal.base_from_left * point).mm() - middle;
        let (found, true_place) = (in_base(found), in_base(predicted.point));
        squares[0] += (found.z - true_place.z).powi(2);
        squares[1] += (found.norm() - true_place.norm()).powi(2);
    }
    Some(squares.map(|sum| (sum / f64::from(samples)).sqrt()))
}

#[test]
fn predicted_depth_errors_agree_with_sampled_ones() {
    let rig = bench();
    let mut checked = 0;
    for (baseline, separation) in [(145.0, 0.0), (145.0, 120.0), (60.0, 30.0), (220.0, 90.0)] {
        let values = pose(baseline, separation);
        for (azimuth, range) in [(0.0, 350.0), (30.0, 350.0), (-20.0, 1500.0), (60.0, 700.0)] {
            let field = DepthField::new(&rig, &values, PIXEL_SIGMA);
            let predicted = field.at(Angle::from_deg(azimuth), level(), Length::from_mm(range));
            let came = sampled(&rig, &values, azimuth, range, 4000);
            let (Some(predicted), Some(came)) = (predicted, came) else { continue };
            println!("{baseline} {separation} {azimuth} {range}: {came:.4?} {predicted:?}");
            for (found, expected) in came.iter().zip([predicted.sigma_forward, predicted.sigma_range]) {
                // Ten per cent; four thousand samples are good to one.
                assert!((found / expected.mm() - 1.0).abs() < 0.10, "{found} {expected}");
            }
            checked += 1;
        }
    }
    assert!(checked >= 12, "{checked}");
}

#[test]
fn a_point_that_one_camera_does_not_see_has_no_depth() {
    let rig = bench();
    let field = DepthField::new(&rig, &pose(145.0, 120.0), PIXEL_SIGMA);
    assert!(field.at(Angle::from_deg(0.0), level(), Length::from_mm(350.0)).is_some());
    assert!(field.at(Angle::from_deg(60.0), level(), Length::from_mm(350.0)).is_none());
}

/// The best pose is at least as good as every pose of a fine grid.
#[test]
fn no_pose_of_a_fine_grid_is_better() {
    let rig = bench();
    for (text, possible) in [
        ("sigma_z <= 1mm at 350mm over +-40deg", true),
        ("sigma_range <= 3mm at 1m over +-25deg", true),
        ("sigma_z <= 0.01mm at 2m over +-40deg", false),
    ] {
        let goal: DepthGoal = text.parse().expect("a goal");
        let best = rig.best_pose(&goal, PIXEL_SIGMA);
        println!("{goal}: {best:?}");
        assert_eq!(best.meets_goal(), possible, "{goal}");
        for i in 0..=40 {
            for k in 0..=40 {
                let values = pose(60.0 + 160.0 * f64::from(i) / 40.0, 130.0 * f64::from(k) / 40.0);
                let other = rig.rate_pose(&values, &goal, PIXEL_SIGMA);
                assert!(!other.is_better_than(&best), "{goal}: {other:?} is better than {best:?}");
            }
        }
    }
}
