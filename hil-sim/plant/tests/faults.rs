//! The ways in which the mechanics fail, each alone.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use vergence_control::RigIo;
use vergence_plant::{EncoderFault, NativeBoard, Plant, SwitchNoise, bench_mechanics, bench_settings};
use vergence_protocol::{ControllerState, Microseconds, ResetCause};

const START: f64 = 100_000.0;
/// 1.6 steps and 2 counts for each micrometre of the baseline.
const STEPS: i32 = 16_000;
const WAY: f64 = 10_000.0;
const COUNTS: i32 = 20_000;

/// The bench with drivers on, the baseline in the middle.
fn plant() -> Plant {
    let mut plant = Plant::new(&bench_mechanics(), &[START, 1_000_000.0]);
    plant.set_drivers(true);
    plant
}

/// Makes all steps of [`WAY`] in a tenth of a second and lets the load come to rest.
fn travel(plant: &mut Plant, from_us: u64, steps: i32) {
    plant.step_to(0, steps, Microseconds(from_us + 100_000));
    for ms in 1..=200 {
        plant.advance(Microseconds(from_us + ms * 1_000));
    }
}

fn check_load(plant: &Plant, expected: f64) {
    let off = plant.load(0).unwrap() - expected;
    assert!(off.abs() < 5.0, "{off}");
}

#[test]
fn a_stuck_encoder_stands_and_knows_the_truth_afterwards() {
    let mut plant = plant();
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Stuck));
    travel(&mut plant, 0, STEPS);
    assert_eq!(plant.encoder(0), 0);
    check_load(&plant, START + WAY);
    plant.axis_mut(0).unwrap().fail_encoder(None);
    assert!((plant.encoder(0) - COUNTS).abs() < 10);
}

#[test]
fn a_reversed_encoder_turns_back_where_it_was_reversed() {
    let mut plant = plant();
    travel(&mut plant, 0, STEPS);
    let here = plant.encoder(0);
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Reversed));
    assert_eq!(plant.encoder(0), here);
    travel(&mut plant, 200_000, 2 * STEPS);
    assert!(plant.encoder(0).abs() < 20, "{}", plant.encoder(0));
}

#[test]
fn a_noisy_encoder_stays_within_its_amplitude_and_a_dead_one_reads_zero() {
    let mut plant = plant();
    travel(&mut plant, 0, STEPS);
    let truth = plant.encoder(0);
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Noisy { amplitude: 50, seed: 1 }));
    let errors: Vec<i32> = (1..=500)
        .map(|ms| {
            plant.advance(Microseconds(200_000 + ms * 1_000));
            plant.encoder(0) - truth
        })
        .collect();
    assert!(errors.iter().all(|error| error.abs() <= 50));
    assert!(errors.iter().any(|error| *error > 30) && errors.iter().any(|error| *error < -30));
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Dead));
    assert_eq!(plant.encoder(0), 0);
}

#[test]
fn a_stalled_motor_counts_its_steps_and_stands() {
    let mut plant = plant();
    plant.axis_mut(0).unwrap().stall(true);
    travel(&mut plant, 0, STEPS);
    assert_eq!(plant.steps(0), STEPS);
    check_load(&plant, START);
    plant.axis_mut(0).unwrap().stall(false);
    travel(&mut plant, 200_000, 2 * STEPS);
    check_load(&plant, START + WAY);
}

#[test]
fn lost_steps_are_missed_in_motion_and_never_throw_the_load() {
    let mut plant = plant();
    plant.axis_mut(0).unwrap().lose_steps(1_600);
    plant.advance(Microseconds(50_000));
    check_load(&plant, START);
    travel(&mut plant, 50_000, STEPS);
    check_load(&plant, START + WAY - 1_000.0);
    travel(&mut plant, 250_000, 0);
    check_load(&plant, START - 1_000.0);
}

#[test]
fn a_switch_chatters_only_after_it_changed() {
    let mut mechanics = bench_mechanics();
    mechanics[0].home_switch = START + WAY / 2.0;
    let mut plant = Plant::new(&mechanics, &[START, 0.0]);
    plant.set_drivers(true);
    plant.axis_mut(0).unwrap().disturb_home_switch(Some(SwitchNoise { chatter_us: 20_000, spikes: 0.0, seed: 1 }));
    plant.step_to(0, STEPS, Microseconds(100_000));
    let readings: Vec<bool> = (1..=200)
        .map(|ms| {
            plant.advance(Microseconds(ms * 1_000));
            plant.home_switch(0)
        })
        .collect();
    let changes: Vec<usize> = (1..200).filter(|&ms| readings[ms] != readings[ms - 1]).collect();
    assert!(changes.len() > 3, "{changes:?}");
    assert!(changes.last().unwrap() - changes[0] <= 21, "{changes:?}");
    assert!(readings[0] && !readings[199]);
}

#[test]
fn a_restarted_board_has_forgotten_everything_but_where_its_stages_stand() {
    let mut board = NativeBoard::standing_at(&bench_settings(), &bench_mechanics(), &[START, 500_000.0], 1).unwrap();
    board.advance(Microseconds(2_000_000));
    board.plant_mut().set_drivers(true);
    board.restart(ResetCause::Watchdog, 2).unwrap();
    assert_eq!((board.now(), board.state()), (Microseconds(0), ControllerState::Idle));
    assert!(!board.plant().drivers_on());
    board.advance(Microseconds(1_000_000));
    assert_eq!(board.plant().loads(), [START, 500_000.0]);
}
