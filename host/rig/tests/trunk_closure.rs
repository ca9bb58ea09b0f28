//! Whether a pose tells how the readings of a trunk fit its closed loop, and refuses readings that cannot all be right.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_rig::{Rig, TrunkClosure};

fn rig() -> Rig {
    Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file")
}

/// With the joints read in degrees: front corner, rear corner, side joint, rear fold, front fold.
fn read(rig: &Rig, degrees: [f64; 5]) -> TrunkClosure {
    rig.pose_read_at(&degrees.map(f64::to_radians)).closure.expect("a trunk")
}

/// Standard deviation of a corner in degrees: its zero by the drawing, its play, half of that of a passive joint, a count of its
/// encoder.
fn corner_sigma() -> f64 {
    let step = 360.0 / 4096.0 / 12f64.sqrt();
    [0.5, 0.125, 0.1, step].iter().map(|part: &f64| part * part).sum::<f64>().sqrt()
}

#[test]
fn modes_close_and_gecko_alone_is_near_a_dead_centre() {
    let rig = rig();
    for mode in &rig.modes {
        let values: Vec<f64> = mode.targets.iter().map(|target| target.value()).collect();
        for pose in [rig.pose_at_values(&values), rig.pose_read_at(&values)] {
            let closure = pose.closure.clone().expect("a trunk");
            assert!(closure.missed < 1e-5 && closure.suspects.is_empty(), "{}: {closure:?}", mode.name);
            assert_eq!(closure.is_near_dead_centre, mode.name == "gecko");
            assert_eq!(pose.check_closure(), Ok(()));
        }
    }
}

#[test]
fn a_bench_has_no_loop_to_close() {
    let bench = Rig::from_toml(vergence_rig::BENCH_TOML).expect("the bench");
    let pose = bench.pose_read_at(&[145.0, 0.5]);
    assert!(pose.closure.is_none() && pose.check_closure().is_ok());
}

#[test]
fn a_little_beyond_the_dead_centre_is_used_and_told() {
    let closure = read(&rig(), [91.0, 90.0, 180.0, 180.0, 180.0]);
    // Each of three corners takes a third of one degree.
    let expected = 1.0 / (3f64.sqrt() * corner_sigma());
    assert!((closure.missed - expected).abs() < 0.02 * expected, "{closure:?}, not {expected}");
    assert!(closure.check().is_ok() && closure.suspects.is_empty());
}

#[test]
fn a_corner_far_beyond_the_dead_centre_is_refused_by_name() {
    let closure = read(&rig(), [97.0, 90.0, 180.0, 180.0, 180.0]);
    let error = closure.check().expect_err("7 degrees are no noise");
    let named: Vec<&str> = error.suspects.iter().map(|(axis, _)| axis.as_str()).collect();
    assert!(named.contains(&"front_corner") && !named.iter().any(|axis| axis.contains("fold")), "{named:?}");
    for (axis, by) in &error.suspects {
        assert!((4.0..8.0).contains(&by.deg().abs()), "{axis}: {by:?}");
    }
    let text = error.to_string();
    assert!(text.contains("'front_corner' by +") && text.contains("calibrate stage"), "{text}");
}

#[test]
fn folds_that_differ_are_refused_by_name() {
    let error = read(&rig(), [120.0, 120.0, 120.0, 174.0, 180.0]).check().expect_err("6 degrees are no noise");
    let named: Vec<(&str, f64)> = error.suspects.iter().map(|(axis, by)| (axis.as_str(), by.deg().round())).collect();
    assert!(named.contains(&("rear_fold", -6.0)) || named.contains(&("front_fold", 6.0)), "{named:?}");
}

#[test]
fn a_folded_trunk_tells_which_corner_is_wrong() {
    let rig = rig();
    assert!(read(&rig, [140.0, 140.0, 80.0, 140.0, 140.0]).missed < 1e-6, "both sides alike");
    let wrong = |degrees: [f64; 5]| {
        let error = read(&rig, degrees).check().expect_err("6 degrees are no noise");
        error.suspects.iter().map(|(axis, by)| (axis.clone(), by.deg().round())).collect::<Vec<_>>()
    };
    assert_eq!(wrong([140.0, 140.0, 86.0, 140.0, 140.0]), [("side_joint".to_owned(), 6.0)]);
    assert_eq!(wrong([132.0, 140.0, 80.0, 140.0, 140.0]), [("front_corner".to_owned(), -8.0)]);
    assert_eq!(wrong([132.0, 140.0, 88.0, 140.0, 148.0]), []);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Against a search over directions that asks only whether the closed form of the six-bar has a shape.
    #[test]
    fn no_closed_shape_is_nearer_than_stated(front in 85.0..96.0_f64, rear in 85.0..96.0_f64, side in 172.0..188.0_f64) {
        let rig = rig();
        let links = rig.trunk.as_ref().expect("a trunk").links.six_bar();
        let closes = |corners: [f64; 3]| {
            // In the order of the six-bar the side joint is the second.
            links.shapes([corners[0], corners[2], corners[1]].map(f64::to_radians)).is_ok()
        };
        let here = [front, rear, side];
        prop_assume!(!closes(here));
        let stated = read(&rig, [front, rear, side, 180.0, 180.0]).missed * corner_sigma();
        // Points spread evenly over a sphere (Fibonacci), and the least distance at which one closes.
        let reached = |distance: f64| {
            (0..4000).any(|index| {
                let z: f64 = 1.0 - (2.0 * f64::from(index) + 1.0) / 4000.0;
                let (turn, across) = (f64::from(index) * 2.399_963_229_728_653, (1.0 - z * z).sqrt());
                let way = [across * turn.cos(), across * turn.sin(), z];
                closes(std::array::from_fn(|joint| here[joint] + distance * way[joint]))
            })
        };
        prop_assert!(!reached(0.97 * stated - 1e-3), "one is nearer than {stated}");
        prop_assert!(reached(1.03 * stated + 1e-3), "none is so near as {stated}");
    }
}
