//! Scenarios with the board's own firmware on the simulated chip: no promise is broken there either.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod programs;

use std::convert::Infallible;

use programs::flash;
use rayon::prelude::*;
use vergence_plant::Plant;
use vergence_soak::{ChipBoard, FaultKind, Promise, Scenario, run, soak, stages};

#[test]
fn the_firmware_breaks_no_promise_whatever_the_fault() {
    FaultKind::ALL.into_par_iter().enumerate().for_each(|(index, kind)| {
        let scenario = Scenario::of_kind(index as u64 + 1, kind);
        let outcome = run(&scenario, &mut flash().board(&scenario));
        println!("{kind}: {:?} after {:.1} s", outcome.ending, outcome.virtual_time.0 as f64 * 1e-6);
        assert!(outcome.violations.is_empty(), "{}", outcome.journal);
    });
}

#[test]
fn random_scenarios_break_no_promise() {
    let named = |name: &str| std::env::var(name).ok().map(|number| number.parse().expect("a number"));
    let Some(count) = named("VERGENCE_ELF_SCENARIOS") else {
        return println!(
            "SKIPPED random scenarios: VERGENCE_ELF_SCENARIOS names how many, two seconds each, and \
             VERGENCE_ELF_SCENARIOS_FROM the first seed"
        );
    };
    let first = named("VERGENCE_ELF_SCENARIOS_FROM").unwrap_or(1);
    let board = |scenario: &Scenario| Ok::<ChipBoard, Infallible>(flash().board(scenario));
    let tally = soak(first, count, board, || {}).expect("boards cannot fail");
    println!("{}\n{:.0} s of virtual time", tally.table(), tally.virtual_seconds);
    assert!(tally.violations.is_empty(), "{:#?}", tally.violations);
}

#[test]
fn the_same_seed_gives_the_same_log() {
    let play = |seed| {
        let scenario = Scenario::of(seed);
        run(&scenario, &mut flash().board(&scenario))
    };
    assert_eq!(play(3), play(3));
}

/// The checker finds a defect through the chip as well: here stages without switches, which the firmware cannot save.
#[test]
fn missing_switches_are_found() {
    let mechanics = stages().map(|stage| {
        let mut mechanics = stage.mechanics;
        mechanics.home_switch = -1e9;
        mechanics.hard_limits = [-1e9, 1e9];
        mechanics
    });
    let broken = (1..=6).any(|seed| {
        let scenario = Scenario::of(seed);
        let outcome = run(&scenario, &mut flash().board_before(Plant::new(&mechanics, &scenario.positions)));
        outcome.violations.iter().any(|violation| violation.promise == Promise::HardLimit)
    });
    assert!(broken, "the stages ran beyond their hard limits and nobody noticed");
}
