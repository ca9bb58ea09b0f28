//! The robot on the native board: each harm, several times.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use vergence_rig::Rig;
use vergence_soak::robot::{HarmKind, RobotScenario, native_robot, run_robot, soak_robot};

fn origaker() -> Rig {
    Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).unwrap()
}

#[test]
fn each_harm_ends_safe_and_the_robot_can_be_used_again() {
    let rig = origaker();
    let count = 2 * HarmKind::ALL.len() as u64;
    let tally = soak_robot(&rig, 1, count, |scenario| native_robot(&rig, scenario), || {}).unwrap();
    assert!(tally.violations.is_empty(), "{}", tally.accusation().unwrap());
    assert!(tally.by_kind.iter().all(|(_, [scenarios, ..])| *scenarios == 2), "{}", tally.table());
}

#[test]
fn the_same_seed_gives_the_same_log() {
    let rig = origaker();
    let play = |seed| {
        let scenario = RobotScenario::of(seed, rig.modes.len());
        run_robot(&rig, &scenario, &mut native_robot(&rig, &scenario).unwrap())
    };
    assert_eq!(play(3), play(3));
    assert_ne!(play(3).journal, play(16).journal);
}
