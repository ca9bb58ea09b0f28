//! The robot's mission with modes that it chooses itself, and the same with ordered modes.
#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    clippy::panic,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::time::Duration;

use common::Robot;

use vergence_reproduce::corridor::{
    Built, Comparison, Corridor, Mission, Orders, Outlooks, Place, PlacedJoints, STORY, Sight, Station, compare,
};
use vergence_rig::Rig;
use vergence_scene::CorridorPlan;

const ORIGAKER: &str = include_str!("../../../docs/rigs/origaker.toml");
const RENDERED: Sight = Sight::Rendered(|| Duration::ZERO);

fn rig() -> Rig {
    Rig::from_toml(ORIGAKER).expect("the robot's file").with_sensors(640).expect("a sensor")
}

fn corridors(few: u32) -> u32 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

#[test]
fn modes_by_the_policy_against_ordered_modes() {
    let compared = compare(&rig(), corridors(4), Sight::Sampled, &|| ()).expect("missions");
    println!("{}", Comparison::HEAD);
    for row in &compared {
        println!("{}", row.in_words());
    }
    let [auto, paper, gecko, ..] = &compared[..] else { panic!("{compared:?}") };
    assert_eq!([auto.orders, paper.orders, gecko.orders], [Orders::Auto, Orders::Paper, Orders::Fixed(0)]);
    let found = auto.found_and_measured();
    assert!(found[0] == auto.outcomes.len() && found[1] == found[0], "{found:?}");
    // It changes only where that pays: less often than by hand, and never on and on.
    assert!(auto.changes() <= paper.changes() && auto.outcomes.iter().all(|outcome| outcome.changes <= 3));
    assert!(auto.target_error_mm()[0] < 2.0 && auto.wall_error_mm()[0].abs() < 5.0, "{auto:?}");
    // No change costs nothing.
    assert!(gecko.changes() == 0.0 && gecko.seconds() < auto.seconds());
}

/// Median relative error, number of points, and errors of both walls.
fn figures(station: &Station) -> (f64, usize, [Option<f64>; 2]) {
    let walls = station.walls.expect("looked for");
    let error = |side: usize| walls.measured[side].map(|measured| measured - walls.truth[side]);
    (station.score.all.median, station.cloud.points.len(), [error(0), error(1)])
}

/// The quick way of the comparison stands for the rendered one: errors and numbers of points within a factor, walls within 15 mm.
#[test]
fn drawn_matches_measure_as_rendered_ones_do() {
    let rig = rig();
    let outlooks = Outlooks::of(&rig).expect("modes");
    let plans = [CorridorPlan::default(), CorridorPlan::random(1), CorridorPlan::random(2)];
    let mut ratios = Vec::new();
    for (number, plan) in plans.into_iter().enumerate() {
        let corridor = Built::new(plan);
        for (mode, name) in STORY.into_iter().enumerate() {
            let [drawn, rendered] = [Sight::Sampled, RENDERED].map(|sight| {
                let (seed, orders) = (7 * number as u64, Orders::Fixed(mode));
                let mut joints = PlacedJoints::new(&rig, seed);
                let mut robot = Mission::new((&outlooks, &mut joints), &corridor, orders, sight, seed);
                figures(&robot.station(mode, Place::along(400.0)).expect("a station"))
            });
            println!("corridor {number}, {name}: drawn {drawn:?}, rendered {rendered:?}");
            ratios.push(drawn.0 / rendered.0);
            let points = drawn.1 as f64 / rendered.1 as f64;
            assert!((0.3..3.5).contains(&points), "{points}");
            for (drawn, rendered) in drawn.2.iter().zip(rendered.2) {
                if let (Some(drawn), Some(rendered)) = (drawn, rendered) {
                    assert!((drawn - rendered).abs() < 15.0, "{drawn} {rendered}");
                }
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    println!("median error of drawn matches: {median:.2} times that of rendered ones ({ratios:.2?})");
    assert!((0.4..1.6).contains(&median), "{median}");
}

#[test]
fn the_robot_chooses_its_modes_and_says_why() {
    let rig = Rig::from_toml(ORIGAKER).expect("the robot's file");
    let folder = tempfile::tempdir().expect("a folder");
    let corridor = Corridor::new(&rig, folder.path(), 1, || Duration::ZERO).expect("the robot");
    let mut heard = Vec::new();
    let story =
        corridor.play_auto(&mut Robot::start(&rig, 1), &mut |line| heard.push(line.to_owned())).expect("a story");
    println!("{}", heard.join("\n"));
    assert_eq!(heard, story.lines);
    // The way to the first mode comes before the mission: nobody chose it.
    let [first, chosen @ ..] = &story.changes[..] else { panic!("no change") };
    assert!(first["why"].is_null() && first["to"] == "gecko" && !chosen.is_empty(), "{:?}", story.changes);
    for change in chosen {
        let why = change["why"].as_str().expect("a reason");
        assert!(why.contains("instead of") && why.contains("for the change against"), "{why}");
        assert!(heard.iter().any(|line| line == why));
        let strip =
            format!("{}-to-{}.svg", change["from"].as_str().expect("a mode"), change["to"].as_str().expect("a mode"));
        assert!(folder.path().join(&strip).is_file(), "{strip}");
    }
    let error = story.found["target_range_error_mm"].as_f64().expect("a range");
    assert!(error.abs() < 3.0, "{error}");
    assert!(story.mission["area_seen"].as_f64().expect("a share") > 0.7);
    assert!(folder.path().join("corridor.svg").is_file());
}
