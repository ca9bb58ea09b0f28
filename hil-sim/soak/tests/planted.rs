//! Tests of the checker itself: it catches a board with a planted fault of each kind.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod planted_board;

use planted_board::{Defect, PlantedBoard};
use vergence_soak::{Promise, Scenario, run};

/// The promises that scenarios of the first seeds find broken, until `promise` is among them.
fn catches(defect: Defect, promise: Promise) {
    let caught = (1..=400).any(|seed| {
        let scenario = Scenario::of(seed);
        let outcome = run(&scenario, &mut PlantedBoard::new(&scenario, defect));
        outcome.violations.iter().any(|violation| violation.promise == promise)
    });
    assert!(caught, "{defect:?} is not caught as {promise:?}");
}

#[test]
fn an_honest_board_behind_the_same_seam_is_not_accused() {
    for seed in 1..=60 {
        let scenario = Scenario::of(seed);
        let outcome = run(&scenario, &mut PlantedBoard::new(&scenario, Defect::None));
        assert!(outcome.violations.is_empty(), "{}", outcome.journal);
    }
}

#[test]
fn no_lease_check() {
    catches(Defect::NoLeaseCheck, Promise::Lease);
}

#[test]
fn brakes_that_take_too_long() {
    catches(Defect::WeakBrakes, Promise::Lease);
}

#[test]
fn no_range_check() {
    catches(Defect::NoRangeCheck, Promise::Refuses);
}

#[test]
fn nothing_is_refused() {
    catches(Defect::RefusesNothing, Promise::Refuses);
}

#[test]
fn switches_are_not_looked_at() {
    catches(Defect::NoSwitches, Promise::HardLimit);
}

#[test]
fn mode_from_steps() {
    catches(Defect::ModeFromSteps, Promise::Mode);
}

#[test]
fn the_encoder_is_compared_too_loosely() {
    catches(Defect::LooseFollowingCheck, Promise::Follows);
}

#[test]
fn the_latest_fault_replaces_the_first() {
    catches(Defect::LatestFault, Promise::FirstFault);
}

#[test]
fn a_fault_is_forgotten() {
    catches(Defect::FaultForgotten, Promise::FirstFault);
}

#[test]
fn drivers_are_never_cut() {
    catches(Defect::DriversStayOn, Promise::State);
}

#[test]
fn motors_step_by_themselves() {
    catches(Defect::Creeps, Promise::Armed);
}

#[test]
fn a_restart_forgets_nothing() {
    catches(Defect::RestartsWithMemory, Promise::Armed);
}

#[test]
fn requests_stay_unanswered() {
    catches(Defect::StopsAnswering, Promise::Ends);
}

#[test]
fn a_motion_never_ends() {
    catches(Defect::MovesForEver, Promise::Ends);
}

#[test]
fn an_axis_without_reference_moves_too_fast() {
    catches(Defect::FastWithoutReference, Promise::Gentle);
}

#[test]
fn a_new_target_is_accepted_and_forgotten() {
    catches(Defect::ForgetsTheNewTarget, Promise::Mode);
}
