//! The prediction for a mode, by which modes are chosen.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use vergence_pipeline::ModeOutlook;
use vergence_rig::{ModeFigures, Rig, TargetBelief, TaskState};
use vergence_vision::{Angle, Length};

const ORIGAKER: &str = include_str!("../../../docs/rigs/origaker.toml");

fn figures(rig: &Rig, mode: &str, azimuth: f64, range: f64) -> (ModeFigures, Angle) {
    let outlook = ModeOutlook::of(rig, rig.mode(mode).expect("a mode")).expect("zones");
    let target = TargetBelief {
        azimuth: Angle::from_deg(azimuth),
        range: Length::from_mm(range),
        range_sigma: Length::from_mm(20.0),
    };
    let state = TaskState {
        seconds: 0.0,
        target: Some(target),
        walls: [Length::from_mm(550.0); 2],
        way_left: Length::from_mm(2000.0),
        speed_mm_s: 100.0,
    };
    (outlook.figures(&state, 1.0), outlook.rotation_sigma())
}

#[test]
fn gecko_sees_most_and_measures_worst() {
    let rig = Rig::from_toml(ORIGAKER).expect("the robot's file").with_sensors(640).expect("a sensor");
    let [gecko, spider, stick_bug] = ["gecko", "spider", "stick-bug"].map(|mode| figures(&rig, mode, 0.0, 420.0));
    let walls = [gecko, spider, stick_bug].map(|(figures, _)| figures.wall_sigma.expect("a wall").mm());
    let target = [gecko, spider, stick_bug].map(|(figures, _)| figures.target_sigma.expect("a target").mm());
    // 293, 236 and 252 degrees of the horizon, 350 mm around the cameras.
    assert!(gecko.0.blind_share < 0.2 && spider.0.blind_share > 0.3 && stick_bug.0.blind_share > 0.25);
    assert!(walls[0] > 1.5 * walls[1] && walls[0] > 1.5 * walls[2], "{walls:?}");
    assert!(target[0] > 1.3 * target[1] && target[0] > 1.3 * target[2], "{target:?}");
    // As the poses of the rendered corridor are known: 0.03, 0.01 and 0.01 degrees with four times as many matches.
    assert!(gecko.1.deg() < 0.08 && gecko.1.deg() > 1.5 * spider.1.deg(), "{} {}", gecko.1, spider.1);
}

/// A target beside the robot is out of the stereo zone of all modes but the crossed one.
#[test]
fn a_target_aside_is_measured_only_where_both_cameras_see_it() {
    let rig = Rig::from_toml(ORIGAKER).expect("the robot's file").with_sensors(640).expect("a sensor");
    let seen = |mode: &str, azimuth: f64| figures(&rig, mode, azimuth, 420.0).0.target_sigma.is_some();
    assert_eq!(["gecko", "spider", "stick-bug"].map(|mode| seen(mode, -40.0)), [false, true, true]);
    assert_eq!(["gecko", "spider", "stick-bug"].map(|mode| seen(mode, -70.0)), [false, false, true]);
}
