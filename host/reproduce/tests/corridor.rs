//! What the robot's story needs; the story itself is played by the command (`tests/robot.rs` of the whole).
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod common;

use std::time::Duration;

use common::Robot;
use vergence_reproduce::corridor::{Corridor, Joints, PlacedJoints};
use vergence_rig::Rig;

#[test]
fn a_rig_without_a_trunk_has_no_such_story() {
    let rig = Rig::from_toml(vergence_rig::BENCH_TOML).expect("the bench");
    let refused = Corridor::new(&rig, std::path::Path::new("."), 1, || Duration::ZERO)
        .map(|_| ())
        .map_err(|error| error.to_string());
    assert!(refused.as_ref().is_err_and(|error| error.contains("gecko")), "{refused:?}");
}

/// The controller brings the trunk to a mode within what the planned way and the settling of the joints take; the pose read is that of the
/// trunk but for play and springs, and at the dead centre for what these do there.
#[test]
fn the_controller_brings_the_trunk_to_its_modes() {
    let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file");
    let mut robot = Robot::start(&rig, 3);
    for (mode, planned, most_deg) in [("gecko", 1.75, 6.0), ("spider", 1.75, 0.5), ("stick-bug", 2.17, 0.5)] {
        let took = robot.go_to(mode).expect("it goes there").expect("a controller takes time");
        assert!((planned..planned + 0.6).contains(&took), "{mode}: {took}");
        let standing = robot.standing().expect("a pose");
        let [read, truth] = [&standing.by_joints, &standing.truth].map(|pose| pose.left_from_right.rotation());
        let off = read.angle_to(&truth).to_degrees();
        assert!(off > 0.0 && off < most_deg, "{mode}: {off}");
        let targets = &rig.mode(mode).expect("a mode").targets;
        let missed = standing.by_joints.axes.iter().zip(targets).map(|(read, to)| read.minus(*to).value().abs());
        assert!(missed.fold(0.0, f64::max) < 0.5_f64.to_radians(), "{mode}: {:?}", standing.by_joints.axes);
    }
    let unknown = robot.go_to("dog").map_err(|error| error.to_string());
    assert!(unknown.as_ref().is_err_and(|error| error.contains("no mode dog")), "{unknown:?}");
}

/// Time passes for the joints while the robot walks: their play wanders, so that no two stations are alike.
#[test]
fn the_play_of_the_joints_wanders_while_the_robot_walks() {
    let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file");
    let mut robot = Robot::start(&rig, 1);
    let mut truth = |seconds: f64| {
        robot.walk(seconds).expect("it is held");
        robot.standing().expect("a pose").truth.left_from_right.rotation()
    };
    let [first, at_once, later] = [0.0, 0.0, 8.0].map(&mut truth);
    assert!(first.angle_to(&at_once) < 0.2 * first.angle_to(&later), "{first} {at_once} {later}");
    let mut placed = PlacedJoints::new(&rig, 1);
    assert_eq!(placed.go_to("spider").expect("placed"), None, "nothing moves them");
}
