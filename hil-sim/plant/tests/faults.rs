//! Failures of the mechanics, each alone.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use vergence_control::{RigIo, StepSchedule};
use vergence_plant::{EncoderFault, NativeBoard, Plant, SwitchNoise, bench_mechanics, bench_settings};
use vergence_protocol::{ControllerState, Microseconds, ResetCause};

const START: f64 = 100_000.0;
/// 0.8 steps and 2 counts for each micrometre of the baseline.
const STEPS: i32 = 8_000;
const WAY: f64 = 10_000.0;
const COUNTS: i32 = 20_000;

/// The bench with drivers on, the baseline in the middle.
fn plant() -> Plant {
    let mut plant = Plant::new(&bench_mechanics(), &[START, 1_000_000.0]);
    plant.set_drivers(true);
    plant
}

/// Orders `steps` of the baseline, evenly over 200 ms.
fn order(plant: &mut Plant, from_us: u64, steps: i32) {
    let a_tick = steps.unsigned_abs() / 200;
    for ms in 0..200 {
        let start = Microseconds(from_us + ms * 1_000);
        let at_ns = (0..a_tick).map(|step| step * 1_000_000 / a_tick).collect();
        plant.schedule_steps(0, &StepSchedule { start, forward: steps > 0, at_ns });
    }
}

/// Makes `steps` steps and lets the load come to rest.
fn travel(plant: &mut Plant, from_us: u64, steps: i32) {
    order(plant, from_us, steps);
    for ms in 1..=250 {
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
fn an_encoder_without_supply_misses_what_is_moved_meanwhile() {
    let mut plant = plant();
    travel(&mut plant, 0, STEPS);
    let before = plant.encoder(0);
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Stuck));
    travel(&mut plant, 250_000, STEPS);
    assert_eq!(plant.encoder(0), before);
    plant.axis_mut(0).unwrap().mend_encoder();
    assert_eq!(plant.encoder(0), before);
    travel(&mut plant, 500_000, STEPS);
    assert!((plant.encoder(0) - before - COUNTS).abs() < 10);
    check_load(&plant, START + 3.0 * WAY);
}

#[test]
fn a_dead_hard_limit_reads_as_it_was_told() {
    let beyond = bench_mechanics()[0].hard_limits[1] + 1.0;
    let mut plant = Plant::new(&bench_mechanics(), &[beyond, 1_000_000.0]);
    assert!(plant.hard_limit(0));
    plant.axis_mut(0).unwrap().fix_hard_limit(Some(false));
    assert!(!plant.hard_limit(0));
    plant.axis_mut(0).unwrap().fix_hard_limit(None);
    assert!(plant.hard_limit(0));
}

#[test]
fn a_mended_encoder_goes_on_from_the_count_that_it_shows() {
    let mut plant = plant();
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Stuck));
    travel(&mut plant, 0, STEPS);
    plant.axis_mut(0).unwrap().mend_encoder();
    assert_eq!(plant.encoder(0), 0);
    travel(&mut plant, 300_000, STEPS);
    assert!((plant.encoder(0) - COUNTS).abs() < 10);
}

/// The counter is in the chip: the native board's went on counting from where it got power.
#[test]
fn a_restart_counts_from_zero_again_also_with_a_stuck_encoder() {
    for fault in [None, Some(EncoderFault::Stuck), Some(EncoderFault::Reversed)] {
        let mut plant = plant();
        travel(&mut plant, 0, STEPS);
        plant.axis_mut(0).unwrap().fail_encoder(fault);
        plant.restart_clock();
        assert_eq!(plant.encoder(0), 0, "{fault:?}");
    }
}

#[test]
fn recorded_steps_are_those_that_were_made_at_their_instants() {
    let mut plant = plant();
    plant.record_steps();
    travel(&mut plant, 0, 400);
    let made = plant.axis_mut(0).unwrap().take_steps();
    let at: Vec<u64> = (0..400).map(|step| step * 500_000).collect();
    assert_eq!(made.iter().map(|step| step.at_ns).collect::<Vec<_>>(), at);
    assert!(made.iter().all(|step| step.forward) && plant.steps(0) == 400);
    assert!(plant.axis_mut(0).unwrap().take_steps().is_empty());
}

#[test]
fn a_reversed_encoder_turns_back_where_it_was_reversed() {
    let mut plant = plant();
    travel(&mut plant, 0, STEPS);
    let here = plant.encoder(0);
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Reversed));
    assert_eq!(plant.encoder(0), here);
    travel(&mut plant, 300_000, STEPS);
    assert!(plant.encoder(0).abs() < 20, "{}", plant.encoder(0));
}

#[test]
fn a_noisy_encoder_stays_within_its_amplitude_and_a_dead_one_reads_zero() {
    let mut plant = plant();
    travel(&mut plant, 0, STEPS);
    let truth = plant.encoder(0);
    plant.axis_mut(0).unwrap().fail_encoder(Some(EncoderFault::Noisy { amplitude: 50, seed: 1 }));
    // The load may stand between two counts.
    let errors: Vec<i32> = (1..=500)
        .map(|ms| {
            plant.advance(Microseconds(300_000 + ms * 1_000));
            plant.encoder(0) - truth
        })
        .collect();
    assert!(errors.iter().all(|error| error.abs() <= 51));
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
    travel(&mut plant, 300_000, STEPS);
    check_load(&plant, START + WAY);
}

#[test]
fn lost_steps_are_missed_in_motion_and_never_throw_the_load() {
    let mut plant = plant();
    plant.axis_mut(0).unwrap().lose_steps(800);
    plant.advance(Microseconds(50_000));
    check_load(&plant, START);
    travel(&mut plant, 50_000, STEPS);
    check_load(&plant, START + WAY - 1_000.0);
    travel(&mut plant, 350_000, -STEPS);
    check_load(&plant, START - 1_000.0);
}

#[test]
fn a_switch_chatters_only_after_it_changed() {
    let mut mechanics = bench_mechanics();
    mechanics[0].home_switch = START + WAY / 2.0;
    let mut plant = Plant::new(&mechanics, &[START, 0.0]);
    plant.set_drivers(true);
    plant.axis_mut(0).unwrap().disturb_home_switch(Some(SwitchNoise { chatter_us: 20_000, spikes: 0.0, seed: 1 }));
    order(&mut plant, 0, STEPS);
    let readings: Vec<bool> = (1..=250)
        .map(|ms| {
            plant.advance(Microseconds(ms * 1_000));
            plant.home_switch(0)
        })
        .collect();
    let changes: Vec<usize> = (1..250).filter(|&ms| readings[ms] != readings[ms - 1]).collect();
    assert!(changes.len() > 3, "{changes:?}");
    assert!(changes.last().unwrap() - changes[0] <= 21, "{changes:?}");
    assert!(readings[0] && !readings[249]);
}

#[test]
fn a_restarted_board_has_forgotten_everything_but_where_its_stages_stand() {
    let mut board = NativeBoard::standing_at(&bench_settings(), &bench_mechanics(), &[START, 500_000.0], 1).unwrap();
    board.advance(Microseconds(2_000_000));
    board.plant_mut().set_drivers(true);
    board.restart(ResetCause::Watchdog, 2).unwrap();
    assert_eq!((board.now(), board.state()), (Microseconds(0), ControllerState::Boot));
    assert!(!board.plant().drivers_on());
    board.advance(Microseconds(5_000));
    assert_eq!(board.state(), ControllerState::SelfTest);
    board.advance(Microseconds(1_000_000));
    assert_eq!(board.state(), ControllerState::Idle);
    assert_eq!(board.plant().loads(), [START, 500_000.0]);
}

#[test]
fn steps_are_made_at_their_instants() {
    let mut plant = plant();
    let schedule = |start, forward, at_ns: &[u32]| StepSchedule {
        start: Microseconds(start),
        forward,
        at_ns: at_ns.iter().copied().collect(),
    };
    plant.schedule_steps(0, &schedule(1_000, true, &[0, 1_500, 700_000, 999_999]));
    plant.schedule_steps(0, &schedule(2_000, false, &[500_000]));
    for (now, steps) in [(999, 0), (1_000, 1), (1_001, 1), (1_002, 2), (1_699, 2), (1_700, 3), (2_000, 4), (2_500, 3)] {
        plant.advance(Microseconds(now));
        assert_eq!(plant.steps(0), steps, "at {now}");
    }
}

#[test]
fn the_trigger_latches_the_encoders_at_its_edge() {
    let mut plant = plant();
    order(&mut plant, 0, STEPS);
    plant.advance(Microseconds(100_000));
    plant.fire_trigger(Microseconds(120_250));
    plant.advance(Microseconds(120_250));
    let there = [plant.encoder(0), plant.encoder(1)];
    plant.advance(Microseconds(150_000));
    let edge = plant.take_trigger_edge().unwrap();
    assert_eq!((edge.at, edge.counts.as_slice()), (Microseconds(120_250), &there[..]));
    assert!(plant.encoder(0) > there[0] + 100);
    assert_eq!(plant.take_trigger_edge(), None);
    // A pulse whose time has passed is fired at once.
    plant.fire_trigger(Microseconds(10_000));
    plant.advance(Microseconds(151_000));
    assert_eq!(plant.take_trigger_edge().unwrap().at, Microseconds(150_000));
}
