//! Random sessions on the native board and on the firmware: both do the same. A board on which something was changed is found.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod programs;

use programs::flash;
use vergence_plant::{AxisMechanics, NativeBoard, Plant};
use vergence_protocol::{Micro, Mode, Move, MoveId, Permille, Request, SettingItem, SettingKey, Trigger};
use vergence_soak::differential::{Act, Session, Verdict, differential, play};
use vergence_soak::stages;

/// Sessions to play, unless `VERGENCE_DIFFERENTIAL` names another number.
const SESSIONS: u64 = 12;
/// Places of the stages in the session of the planted differences, in micro-units: near home.
const PLACES: [f64; 2] = [59_000.0, -10_000.0];

#[test]
fn both_boards_do_the_same_in_random_sessions() {
    let named = std::env::var("VERGENCE_DIFFERENTIAL").ok();
    let count = named.map_or(SESSIONS, |count| count.parse().expect("a number of sessions"));
    let tally = differential(1, count, flash(), || {}).expect("the bench works");
    println!("{}\n{:.0} s of virtual time", tally.table(), tally.virtual_seconds);
    assert!(tally.differences.is_empty(), "{}", tally.accusation().unwrap_or_default());
    // It compared something.
    let figures = &tally.figures;
    assert!(figures.messages > 20 * count && figures.poses > 500 * count && figures.steps > 10_000 * count);
}

#[test]
fn the_same_seed_gives_the_same_verdict() {
    let play = || Session::of(2).on_both(flash()).expect("the bench works");
    assert_eq!(play(), play());
}

fn go(number: u16, targets: [i32; 2], pause: u32) -> Act {
    let targets = targets.into_iter().map(Micro).collect();
    Act::Ask(Request::MoveTo(Move { id: MoveId(number), mode: Mode(1), targets, speed: Permille::FULL }), pause)
}

/// Homes, moves with a new target on the way, fires the trigger once.
fn session() -> Session {
    let short = |axis, value| {
        let key = SettingKey { item: SettingItem::HomeRetract, axis };
        Act::Ask(Request::SetSetting { key, value }, 10)
    };
    let acts = vec![
        Act::Open(2_000),
        short(0, 1_000),
        short(1, 12_000),
        Act::Recover,
        go(1, [90_000, 200_000], 350),
        go(2, [62_000, 100_000], 150),
        Act::Ask(Request::SetTrigger(Trigger::Once), 30),
        Act::Rest,
        Act::Recover,
    ];
    Session { seed: 1, acts, positions: PLACES }
}

/// Plays the session with a native board that `plant` has changed.
fn verdict(plant: impl FnOnce(&mut [vergence_plant::Stage; 2])) -> Verdict {
    let honest = stages().map(|stage| stage.mechanics);
    let mut changed = stages();
    plant(&mut changed);
    let (settings, mechanics) = (changed.map(|stage| stage.settings), changed.map(|stage| stage.mechanics));
    let native = NativeBoard::standing_at(&settings, &mechanics, &PLACES, 1).expect("it still works");
    play(&session(), native, flash().board_before(Plant::new(&honest, &PLACES)))
}

/// Fails unless the first difference is in the field `named`.
fn found(named: &str, verdict: &Verdict) {
    let difference = verdict.difference.as_ref().unwrap_or_else(|| panic!("nobody noticed: {named}"));
    assert!(difference.field.contains(named), "{difference}, not {named}");
    let told = verdict.journal.to_string();
    for part in ["native: ", "chip: ", "DIFFERENCE: "] {
        assert!(told.contains(part), "'{part}' is missing in:\n{told}");
    }
}

#[test]
fn boards_that_are_alike_do_not_differ() {
    let verdict = verdict(|_| {});
    assert_eq!(verdict.difference, None, "{}", verdict.journal);
}

#[test]
fn another_speed_or_acceleration_is_found_in_the_instants_of_steps() {
    found("instant of a step of axis", &verdict(|stages| stages[0].settings.speed -= 400));
    found("instant of a step of axis", &verdict(|stages| stages[0].settings.acceleration -= 2_000));
}

#[test]
fn another_range_is_found_in_a_refusal() {
    found("message", &verdict(|stages| stages[0].settings.max = Micro(70_000)));
}

#[test]
fn another_scale_is_found_in_the_counts() {
    found("counts of axis 0", &verdict(|stages| stages[0].mechanics.encoder.per_unit += 5_000));
}

#[test]
fn another_reference_is_found_in_the_true_place() {
    found("true place of axis 0", &verdict(|stages| stages[0].settings.homing.switch_at.0 += 20));
}

#[test]
fn other_mechanics_are_found_in_the_true_place() {
    let off = |mechanics: &mut AxisMechanics, by: f64| mechanics.home_switch += by;
    found("true place of axis 0", &verdict(|stages| off(&mut stages[0].mechanics, 10.0)));
    found("true place of axis 1", &verdict(|stages| off(&mut stages[1].mechanics, -300.0)));
}

#[test]
fn a_fault_on_one_board_is_found() {
    found("a pose", &verdict(|stages| stages[0].mechanics.hard_limits[1] = 64_000.0));
}

#[test]
fn lost_steps_are_found_in_the_true_place() {
    let mechanics = stages().map(|stage| stage.mechanics);
    let mut native =
        NativeBoard::standing_at(&stages().map(|stage| stage.settings), &mechanics, &PLACES, 1).expect("it works");
    // After homing they would only move the reference.
    let mut session = session();
    session.acts.insert(3, Act::Arm);
    let jog = vergence_protocol::Jog {
        id: MoveId(7),
        by: [Micro(2_000), Micro(2_000)].into_iter().collect(),
        speed: Permille::FULL,
    };
    session.acts.insert(4, Act::Ask(Request::Jog(jog), 300));
    native.plant_mut().axis_mut(0).expect("it is there").lose_steps(4);
    found("axis 0", &play(&session, native, flash().board_before(Plant::new(&mechanics, &PLACES))));
}
