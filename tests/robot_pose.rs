//! The robot's pose and points by the command line from rendered images, in each of its modes: as uncertain as stated, where each joint
//! is off by the play that the rig file states and the cameras by what it leaves to a calibration. Corridor, joints and images are simulated; the lenses are known exactly.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::sync::Arc;

use common::rendered::{Measurement, PointError, Truth, band, seeds};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_rig::{Rig, RigCalibration, RigPose};
use vergence_scene::{CorridorPlan, Scene};
use vergence_sim::{Random, Room};
use vergence_vision::Transform;

const ORIGAKER: &str = include_str!("../docs/rigs/origaker.toml");
/// Width of the images: half of the real ones, which takes a quarter of the time.
const WIDTH: u32 = 640;

fn rig() -> Rig {
    Rig::from_toml(ORIGAKER).expect("the robot's file").with_sensors(WIDTH).expect("a sensor")
}

/// Where the joints truly are when they read `mode`: off by the play of their axes, and corners by that of a passive joint too.
fn truly_at(rig: &Rig, mode: &str, random: &mut Random) -> Vec<f64> {
    let trunk = rig.trunk.as_ref().expect("a trunk");
    let mut values: Vec<f64> = rig.mode(mode).expect("a mode").targets.iter().map(|target| target.value()).collect();
    for (joint, &axis) in trunk.axes.iter().enumerate() {
        let passive = if joint < 3 { trunk.passive_play } else { 0.0 };
        values[axis] += 0.5 * rig.axes[axis].play.hypot(passive) * random.normal();
    }
    values
}

/// The pose with the joints there and the cameras off by what the calibration states: what it leaves uncertain is drawn too, or every
/// covariance would be right that is large.
fn true_pose(rig: &Rig, mode: &str, random: &mut Random) -> RigPose {
    let mut pose = rig.pose_at_values(&truly_at(rig, mode, random));
    let RigCalibration::Sigmas { rotation, translation } = rig.calibration else {
        panic!("the robot's file states its calibration goal");
    };
    let turn = UnitQuaternion::from_scaled_axis(random.vector(rotation.rad()));
    let shift = random.vector(translation.mm());
    let by_joints = pose.left_from_right;
    pose.left_from_right = Transform::new(turn * by_joints.rotation(), by_joints.origin().mm() + shift);
    pose
}

/// A random corridor, and the robot somewhere in it.
fn room(seed: u64, random: &mut Random) -> Arc<Room> {
    let scene = Scene::of_corridor(&CorridorPlan::random(40_000 + seed));
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), random.between(-0.3, 0.3));
    let place = Vector3::new(random.between(-80.0, 80.0), 0.0, random.between(-200.0, 900.0));
    Arc::new(Room { scene, world_from_base: Transform::new(turn, place) })
}

/// The robot in `mode`, somewhere, measured by the pose that its joints state.
fn trial(rig: &Rig, mode: &str, seed: u64) -> Measurement {
    let mut random = Random::new(1_000 * seed + 7);
    let pose = true_pose(rig, mode, &mut random);
    let room = room(seed, &mut random);
    Truth { rig, room, pose, seed }.measure(&["--mode", mode])
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// The first trial. What matches share was chosen on trials before it (`vergence_vision`'s `residual_spread`).
const FIRST: u64 = 100;
/// A point whose range is off by more than this many standard deviations is an outlier: its score is the probability that it is none.
const OUTLIER: f64 = 3.0;
/// Mean squared error of a component over its variance, without its outliers.
const OF_ONE: f64 = 0.973;

/// One mode's figures over all trials.
struct Figures {
    of_pose: f64,
    /// Of a point that is no outlier. Points of one pair share the error of the pose: their mean counts as one point, which varies at least
    /// as much.
    of_point: f64,
    /// Parts of the ranges within one, two and three standard deviations, wrong matches included.
    within: [f64; 3],
    /// What the scores state for the last.
    stated: f64,
}

fn figures(rig: &Rig, mode: &str, trials: u64) -> Figures {
    let measured: Vec<Measurement> = (FIRST..FIRST + trials).map(|seed| trial(rig, mode, seed)).collect();
    for one in &measured {
        assert_eq!(one.result["pose"]["from"], "joints and images");
        assert!(one.points.len() > 100, "{mode}: {} points", one.points.len());
    }
    let point = |one: &Measurement| {
        let usual = one.points.iter().filter(|point| point.of_range() < OUTLIER * OUTLIER);
        mean(usual.map(PointError::of_two))
    };
    let part = |one: &Measurement, sigmas: f64| {
        let near = one.points.iter().filter(|point| point.of_range() < sigmas * sigmas).count();
        near as f64 / one.points.len() as f64
    };
    let figures = Figures {
        of_pose: mean(measured.iter().map(Measurement::of_pose)),
        of_point: mean(measured.iter().map(point)),
        within: [1.0, 2.0, OUTLIER].map(|sigmas| mean(measured.iter().map(|one| part(one, sigmas)))),
        stated: mean(measured.iter().map(|one| mean(one.points.iter().map(|point| point.score)))),
    };
    let factor = mean(measured.iter().filter_map(|one| one.result["pose"]["match_variance_factor"].as_f64()));
    let [one, two, three] = figures.within.map(|part| 100.0 * part);
    println!(
        "{mode}: NEES of {trials}: pose {:.2} of 6, a point {:.2} of 2; {one:.1}, {two:.1} and {three:.1} % of the ranges within 1, 2 and 3 \
         sigma, the last stated as {:.1} %; variance of the matches {factor:.2} of the stated one",
        figures.of_pose,
        figures.of_point,
        100.0 * figures.stated
    );
    figures
}

/// Neither less uncertain than stated nor more.
#[test]
fn pose_and_points_are_as_uncertain_as_stated_in_each_mode() {
    let rig = rig();
    let trials = seeds(3);
    let measured = ["gecko", "spider", "stick-bug"].map(|mode| (mode, figures(&rig, mode, trials)));
    for (mode, Figures { of_pose, of_point, within, stated }) in measured {
        let [least, most] = band(trials, 6.0, 2.39);
        assert!((least..most).contains(&of_pose), "{mode}: {of_pose} is not within {least} to {most}");
        let [least, most] = band(trials, 2.0, 2.39).map(|bound| OF_ONE * bound);
        assert!((least..most).contains(&of_point), "{mode}: {of_point} is not within {least} to {most}");
        assert!((0.90..0.996).contains(&within[1]), "{mode}: {within:?}");
        assert!((within[2] - stated).abs() < 0.04, "{mode}: {within:?} {stated}");
    }
}
