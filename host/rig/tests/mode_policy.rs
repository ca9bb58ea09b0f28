//! The policy that chooses modes: it follows the task, and it never chatters.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_rig::{ModeFigures, ModePolicy, PolicyRule, TargetBelief, Task, TaskState};
use vergence_vision::{Angle, Length};

const GECKO: usize = 0;
const SPIDER: usize = 1;
const STICK_BUG: usize = 2;
/// Noise of predicted standard deviations: its square, with which the pairs grow, is below the root of the rule's gain.
const SIGMA_NOISE: f64 = 1.1;

fn figures(blind_share: f64, wall: Option<f64>, target: Option<f64>) -> ModeFigures {
    ModeFigures {
        blind_share,
        wall_sigma: wall.map(Length::from_mm),
        target_sigma: target.map(Length::from_mm),
        change_s: 2.0,
    }
}

/// Figures of three modes as those of the robot, seen from `present`.
fn three(present: usize) -> [ModeFigures; 3] {
    let mut all = [
        figures(0.12, Some(12.0), Some(4.0)),
        figures(0.29, Some(3.0), Some(2.5)),
        figures(0.40, Some(8.0), Some(1.0)),
    ];
    all[present].change_s = 0.0;
    all
}

fn state(seconds: f64, target: Option<(f64, f64)>) -> TaskState {
    TaskState {
        seconds,
        target: target.map(|(range, sigma)| TargetBelief {
            azimuth: Angle::from_deg(-40.0),
            range: Length::from_mm(range),
            range_sigma: Length::from_mm(sigma),
        }),
        walls: [Length::from_mm(550.0); 2],
        way_left: Length::from_mm(3000.0),
        speed_mm_s: 100.0,
    }
}

#[test]
fn the_mode_follows_the_task_and_says_why() {
    let names = ["gecko", "spider", "stick-bug"].map(String::from);
    let mut policy = ModePolicy::new(PolicyRule::default(), STICK_BUG);
    let story = [
        (None, Task::Search, GECKO, "12 % of the horizon unseen, not 40 %"),
        (Some((2000.0, 300.0)), Task::Pass, SPIDER, "walls to 3.00 mm a pair, not 12.00 mm"),
        (Some((420.0, 10.0)), Task::Inspect, STICK_BUG, "target to 1.00 mm a pair, not 2.50 mm"),
    ];
    for (number, (target, task, mode, words)) in story.into_iter().enumerate() {
        let figures = three(policy.mode());
        let choice = policy.choose(&state(10.0 * number as f64, target), &figures).expect("a choice");
        assert_eq!((choice.task, choice.mode), (task, mode));
        let line = choice.in_words(&names);
        assert!(line.contains(words) && line.contains("2.0 s for the change"), "{line}");
    }
}

#[test]
fn a_change_that_takes_longer_than_it_saves_is_not_made() {
    let mut policy = ModePolicy::new(PolicyRule::default(), SPIDER);
    let mut figures = three(SPIDER);
    figures[STICK_BUG].change_s = 30.0;
    let choice = policy.choose(&state(0.0, Some((420.0, 10.0))), &figures).expect("a choice");
    assert!(!choice.changes(), "{choice:?}");
    // No way leads there at all.
    figures[STICK_BUG].change_s = f64::INFINITY;
    figures[SPIDER].target_sigma = None;
    figures[GECKO].target_sigma = Some(Length::from_mm(2.0));
    let choice = policy.choose(&state(9.0, Some((420.0, 10.0))), &figures).expect("a choice");
    assert_eq!(choice.mode, GECKO, "the only other mode that sees the target");
}

#[test]
fn a_range_at_the_edge_of_inspection_keeps_the_task() {
    let mut policy = ModePolicy::new(PolicyRule::default(), SPIDER);
    let mut tasks = Vec::new();
    for (number, range) in [900.0, 480.0, 620.0, 480.0, 690.0, 900.0].into_iter().enumerate() {
        let figures = three(policy.mode());
        tasks.push(policy.choose(&state(10.0 * number as f64, Some((range, 10.0))), &figures).expect("a choice").task);
    }
    let [pass, inspect] = [Task::Pass, Task::Inspect];
    assert_eq!(tasks, [pass, inspect, inspect, inspect, inspect, pass]);
}

fn any_mode() -> impl Strategy<Value = ModeFigures> {
    let sigma = || proptest::option::of(0.01..100.0);
    (0.0..1.0, sigma(), sigma(), 0.0..10.0)
        .prop_map(|(blind, wall, target, change_s)| ModeFigures { change_s, ..figures(blind, wall, target) })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever comes in, changes keep the least stay.
    #[test]
    fn two_changes_are_never_nearer_than_the_least_stay(
        inputs in proptest::collection::vec(
            (0.0..3.0, proptest::option::of((100.0..3000.0, 0.0..500.0)), proptest::array::uniform3(any_mode())), 1..80)
    ) {
        let rule = PolicyRule::default();
        let mut policy = ModePolicy::new(rule, GECKO);
        let (mut seconds, mut last) = (0.0, f64::NEG_INFINITY);
        for (later, target, mut figures) in inputs {
            seconds += later;
            figures[policy.mode()].change_s = 0.0;
            let choice = policy.choose(&state(seconds, target), &figures).expect("a choice");
            if choice.changes() {
                prop_assert!(seconds - last >= rule.least_stay_s, "{} after {}", seconds, last);
                last = seconds;
            }
        }
    }

    /// While nothing truly changes, noise within the stated factor never brings a mode back: at most two changes among three modes.
    #[test]
    fn noise_brings_no_mode_back(
        truth in proptest::array::uniform3(any_mode()),
        target in proptest::option::of((100.0..3000.0, Just(5.0))),
        noise in proptest::collection::vec(proptest::array::uniform3((-1.0..1.0, -1.0..1.0, -1.0..1.0)), 1..80),
    ) {
        let mut policy = ModePolicy::new(PolicyRule::default(), GECKO);
        let mut left = vec![];
        for (number, noise) in noise.into_iter().enumerate() {
            let mut figures = truth;
            for (mode, (blind, wall, target)) in figures.iter_mut().zip(noise) {
                let noisy = |sigma: Option<Length>, by: f64| sigma.map(|sigma| Length::from_mm(sigma.mm() * SIGMA_NOISE.powf(by)));
                mode.blind_share *= SIGMA_NOISE.powf(2.0 * blind);
                (mode.wall_sigma, mode.target_sigma) = (noisy(mode.wall_sigma, wall), noisy(mode.target_sigma, target));
            }
            figures[policy.mode()].change_s = 0.0;
            let choice = policy.choose(&state(10.0 * number as f64, target), &figures).expect("a choice");
            if choice.changes() {
                left.push(choice.before);
                prop_assert!(!left.contains(&choice.mode), "{} again after {:?}", choice.mode, left);
            }
        }
        prop_assert!(left.len() <= 2);
    }
}
