//! Closed loops, beside the tables of the paper's trunk and laws.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::f64::consts::PI;

use proptest::prelude::*;
use vergence_rig::linkage::{CameraMount, Corners, Loop, SixBarError, TrunkCameras, TrunkJoint, TrunkLinks, trunk};

const FLAT: [TrunkJoint; 2] = [TrunkJoint::RearFold, TrunkJoint::FrontFold];

fn shapes(degrees: [f64; 3]) -> Result<Vec<Corners>, SixBarError> {
    TrunkLinks::default().six_bar().shapes(degrees.map(f64::to_radians))
}

fn loop_of_trunk() -> Loop<8> {
    trunk(&TrunkLinks::default())
}

fn driven() -> [bool; 8] {
    TrunkJoint::mask(&TrunkJoint::DRIVEN)
}

/// Interior angles A, B, C, and D, E, F of every shape that the linkage then has, in degrees: solutions found by a search from
/// 200 random starts in other software.
const BRANCHES: [([f64; 3], &[[f64; 3]]); 8] = [
    ([120.0, 120.0, 120.0], &[[120.0, 120.0, 120.0], [60.0, 240.0, 60.0]]),
    ([170.0, 20.0, 170.0], &[[170.0, 20.0, 170.0], [10.0, 340.0, 10.0]]),
    ([90.0, 180.0, 90.0], &[[90.0, 180.0, 90.0]]),
    ([105.0, 150.0, 105.0], &[[105.0, 150.0, 105.0], [75.0, 210.0, 75.0]]),
    ([80.0, 170.0, 90.0], &[[123.516, 121.548, 134.936], [65.064, 238.452, 76.484]]),
    ([80.0, 160.0, 80.0], &[[152.225, 95.549, 152.225], [67.775, 264.451, 67.775]]),
    ([110.0, 130.0, 110.0], &[[127.429, 115.141, 127.429], [62.571, 244.859, 62.571]]),
    ([91.0, 180.0, 90.0], &[]),
];

#[test]
fn all_branches_are_found() {
    for (driven, expected) in BRANCHES {
        let found = shapes(driven);
        if expected.is_empty() {
            assert!(matches!(found, Err(SixBarError::TooFar { .. })), "{driven:?}: {found:?}");
            continue;
        }
        let found = found.expect("a shape");
        assert_eq!(found.len(), expected.len(), "{driven:?}: {found:?}");
        for (shape, expected) in found.iter().zip(expected) {
            let degrees = [3, 4, 5].map(|corner: usize| shape.0[corner].to_degrees());
            let worst = degrees.iter().zip(expected).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            // The table has three digits behind the point.
            assert!(worst < 6e-4, "{driven:?}: {degrees:?}");
        }
    }
}

/// The joint angles of the modes, in degrees: gecko, spider, stick-bug.
#[test]
fn the_modes_close() {
    for (corners, thetas) in [
        ([90.0, 180.0, 90.0, 90.0, 180.0, 90.0], [90.0, 0.0, 90.0, 90.0, 0.0, 90.0]),
        ([120.0; 6], [60.0; 6]),
        ([170.0, 20.0, 170.0, 170.0, 20.0, 170.0], [10.0, 160.0, 10.0, 10.0, 160.0, 10.0]),
    ] {
        let angles = Corners(corners.map(f64::to_radians)).trunk_angles();
        for (joint, theta) in TrunkJoint::CORNERS.into_iter().zip(thetas) {
            assert!((angles[joint.index()].to_degrees() - theta).abs() < 1e-12);
        }
        let error = loop_of_trunk().closure_error(&angles);
        assert!(error < 3e-15, "{corners:?}: {error:e}");
    }
}

/// Interior angles in degrees, and the angle of both folds.
fn mobility(corners: [f64; 6], fold: f64, locked: &[TrunkJoint]) -> usize {
    let mut angles = Corners(corners.map(f64::to_radians)).trunk_angles();
    FLAT.into_iter().for_each(|joint| angles[joint.index()] = fold.to_radians());
    let linkage = loop_of_trunk();
    let error = linkage.closure_error(&angles);
    assert!(error < 1e-12, "{corners:?} folded by {fold}: {error:e}");
    linkage.mobility(&angles, &driven(), &TrunkJoint::mask(locked)).freedom
}

/// Both sides alike, with the side joints at `b` degrees.
fn symmetrical(b: f64) -> [f64; 6] {
    let corner = 180.0 - b / 2.0;
    [corner, b, corner, corner, b, corner]
}

#[test]
fn the_trunk_moves_as_it_should() {
    let bent = shapes([80.0, 170.0, 90.0]).expect("a shape")[0].0.map(f64::to_degrees);
    for b in [180.0, 120.0, 20.0] {
        assert_eq!(mobility(symmetrical(b), 0.0, &FLAT), 3, "flat, folds locked, B {b}");
        assert_eq!(mobility(symmetrical(b), 0.0, &[]), 4, "flat, where the axes of both folds coincide, B {b}");
    }
    assert_eq!(mobility(bent, 0.0, &[]), 3, "flat and bent: no fold moves");
    for fold in [30.0, 90.0, 150.0] {
        assert_eq!(mobility(symmetrical(120.0), fold, &[]), 2, "folded by {fold}");
        assert_eq!(mobility(symmetrical(180.0), fold, &[]), 3, "folded by {fold}, sides straight");
    }
    assert_eq!(mobility(symmetrical(120.0), 180.0, &[]), 4, "fully folded");
    assert_eq!(mobility(symmetrical(180.0), 180.0, &[]), 5, "fully folded, sides straight");
}

#[test]
fn gecko_is_a_dead_centre() {
    let at = |degrees: [f64; 3]| {
        let angles = shapes(degrees).expect("a shape")[0].trunk_angles();
        let locked = TrunkJoint::mask(&FLAT);
        loop_of_trunk().mobility(&angles, &driven(), &locked).distance_to_singularity
    };
    assert!(at([90.0, 180.0, 90.0]) < 1e-7);
    let [near, nearer] = [at([89.0, 180.0, 90.0]), at([89.9, 180.0, 90.0])];
    // The square root of the distance in angle.
    assert!((near / nearer - 10.0_f64.sqrt()).abs() < 0.1, "{near} {nearer}");
}

/// Angle between the optical axes in degrees, positive outward, and distance of the cameras in millimetres.
fn separation_and_baseline(cameras: &TrunkCameras, shape: &Corners) -> [f64; 2] {
    let pose = cameras.left_from_right(&loop_of_trunk(), &shape.trunk_angles());
    let left_from_right = pose.isometry();
    let axis = left_from_right.rotation * nalgebra::Vector3::z();
    [axis.x.atan2(axis.z).to_degrees(), left_from_right.translation.vector.norm()]
}

/// Baselines of the modes with the cameras 0, 20 and 50 mm from the corners, on the links, and with the default mounts.
#[test]
fn the_modes_have_their_separation_and_baseline() {
    for (b, separation, baselines) in [
        (180.0, 120.0, [100.0, 100.0, 100.0, 150.0]),
        (120.0, 60.0, [100.0, 120.0, 150.0, 193.3]),
        (20.0, -40.0, [100.0, 139.4, 198.5, 207.2]),
    ] {
        let shape = Corners(symmetrical(b).map(f64::to_radians));
        let bare = |along| TrunkCameras::alike(140.0, CameraMount { along, outward: 0.0, ..CameraMount::default() });
        let mounts = [bare(0.0), bare(20.0), bare(50.0), TrunkCameras::default()];
        for (cameras, expected) in mounts.iter().zip(baselines) {
            let [found, baseline] = separation_and_baseline(cameras, &shape);
            assert!((found - separation).abs() < 1e-9, "B {b}: {found}");
            assert!((baseline - expected).abs() < 0.05, "B {b}, {cameras:?}: {baseline}");
        }
    }
}

/// Errors of the driven corners A and B in degrees, and the separation that they make of the mode's.
#[test]
fn errors_of_joints_change_the_separation_as_published() {
    for (b, a_error, b_error, separation) in [
        (180.0, -0.1, 0.0, 117.98),
        (180.0, -0.5, 0.0, 115.47),
        (180.0, -1.0, 0.0, 113.60),
        (180.0, -1.0, -1.0, 110.42),
        (120.0, -1.0, 0.0, 59.29),
        (120.0, 0.0, -1.0, 58.30),
        (20.0, -1.0, 0.0, -40.38),
        (20.0, 0.0, 1.0, -38.64),
    ] {
        let corner = 180.0 - b / 2.0;
        // Corner E outward, as in all modes.
        let shape = shapes([corner + a_error, b + b_error, corner]).expect("a shape")[0];
        let [found, _] = separation_and_baseline(&TrunkCameras::default(), &shape);
        assert!((found - separation).abs() < 6e-3, "B {b}, {a_error}, {b_error}: {found}");
    }
}

#[test]
fn the_sensitivity_of_the_cameras_is_that_of_differences() {
    let (linkage, cameras) = (loop_of_trunk(), TrunkCameras::default());
    let shape = shapes([110.0, 130.0, 105.0]).expect("a shape")[0];
    let angles = shape.trunk_angles();
    let slopes = cameras.sensitivity(&linkage, &angles, &driven()).expect("no singularity");
    let pose = cameras.left_from_right(&linkage, &angles);
    let before = pose.isometry();
    for joint in [TrunkJoint::A, TrunkJoint::B, TrunkJoint::C] {
        let by = 1e-6;
        let mut start = angles;
        start[joint.index()] += by;
        let moved = linkage.close(&start, &driven()).expect("it closes").angles;
        let change = cameras.left_from_right(&linkage, &moved).isometry() * before.inverse();
        let turn = change.rotation.scaled_axis() / by;
        let shift =
            (change.translation.vector + change.rotation * before.translation.vector - before.translation.vector) / by;
        for row in 0..3 {
            let (turn_slope, shift_slope) = (slopes[(row, joint.index())], slopes[(row + 3, joint.index())]);
            assert!((turn[row] - turn_slope).abs() < 1e-5, "{joint:?} turn {row}: {} {turn_slope}", turn[row]);
            assert!((shift[row] - shift_slope).abs() < 1e-2, "{joint:?} shift {row}: {} {shift_slope}", shift[row]);
        }
    }
    let gecko = Corners(symmetrical(180.0).map(f64::to_radians)).trunk_angles();
    assert!(cameras.sensitivity(&linkage, &gecko, &driven()).is_err(), "a dead centre");
}

/// Shapes that differ little from each other keep to their branch.
#[test]
fn a_branch_is_followed() {
    let mut last = shapes([120.0, 120.0, 120.0]).expect("a shape")[0];
    for step in 0..=300 {
        let b = 120.0 - f64::from(step) / 3.0;
        let next = last.nearest(&shapes([180.0 - b / 2.0, b, 180.0 - b / 2.0]).expect("a shape")).expect("the same");
        assert!((next.0[4].to_degrees() - b).abs() < 1e-9, "the other side is alike: {next:?}");
        last = next;
    }
}

#[test]
fn what_is_undetermined_is_named() {
    // A, B and C straight lines back on themselves: F falls on D.
    let found = TrunkLinks { half_end: 70.0, ..TrunkLinks::default() }.six_bar().shapes([PI / 2.0, PI / 2.0, PI / 2.0]);
    assert!(matches!(found, Err(SixBarError::Undetermined)), "{found:?}");
}

/// `PROPTEST_CASES=100000` plays that many.
fn cases() -> ProptestConfig {
    let usual = ProptestConfig::default();
    ProptestConfig { cases: usual.cases.max(5_000), ..usual }
}

/// Angles of the driven corners, in degrees.
fn corners() -> impl Strategy<Value = [f64; 3]> {
    [20.0..340.0, 20.0..340.0, 20.0..340.0]
}

proptest! {
    #![proptest_config(cases())]

    /// Closed form and solver agree to 1e-9 away from singularities, and by the square root nearer.
    #[test]
    fn closed_form_and_solver_agree(degrees in corners(), moved in [-0.05..0.05, -0.05..0.05, -0.05..0.05]) {
        let linkage = loop_of_trunk();
        let found = shapes(degrees);
        let locked = TrunkJoint::mask(&FLAT);
        if let Err(SixBarError::TooFar { apart_mm, reach_mm }) = found {
            let start = Corners(degrees.map(f64::to_radians).into_iter().chain([PI; 3]).collect::<Vec<_>>().try_into().expect("six"));
            prop_assert!(apart_mm - reach_mm < 1e-6 || linkage.close(&start.trunk_angles(), &driven()).is_err());
            return Ok(());
        }
        for shape in found.expect("a shape") {
            let angles = shape.trunk_angles();
            prop_assert!(linkage.closure_error(&angles) < 1e-12);
            let distance = linkage.mobility(&angles, &driven(), &locked).distance_to_singularity;
            let mut start = angles;
            for (joint, by) in [TrunkJoint::D, TrunkJoint::E, TrunkJoint::F].into_iter().zip(moved) {
                start[joint.index()] += by * distance.min(1.0);
            }
            let closed = linkage.close(&start, &driven()).expect("it closes");
            prop_assert!(closed.error <= 1e-12);
            let apart = closed.angles.iter().zip(angles).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            // A residual of 1e-13 over the smallest slope; at a dead centre over the square.
            let allowed = if distance > 1e-3 { 1e-9 } else { 1e-6 };
            prop_assert!(apart < allowed, "{apart:e} at a distance of {distance:e} from singularity");
        }
    }

    /// Passive joints follow driven ones as the derivative says.
    #[test]
    fn passive_joints_follow(degrees in corners(), joint in 0..3_usize) {
        let Ok(found) = shapes(degrees) else { return Ok(()) };
        let linkage = loop_of_trunk();
        for shape in found {
            let angles = shape.trunk_angles();
            if linkage.mobility(&angles, &driven(), &TrunkJoint::mask(&FLAT)).distance_to_singularity < 0.05 {
                continue;
            }
            let following = linkage.following(&angles, &driven()).expect("no singularity");
            let by = 1e-6;
            let mut moved = shape.0;
            moved[joint] -= by;
            let next = shape.nearest(&shapes([0, 1, 2].map(|corner: usize| moved[corner].to_degrees())).expect("a shape"));
            let next = next.expect("a shape").trunk_angles();
            for row in 0..8 {
                let difference = (next[row] - angles[row]) / by;
                let slope = following[(row, TrunkJoint::CORNERS[joint].index())];
                prop_assert!((difference - slope).abs() < 2e-3 * (1.0 + slope.abs()), "joint {row}: {difference} {slope}");
            }
        }
    }
}
