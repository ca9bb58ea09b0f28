//! StallGuard of the simulated TMC2209: when it reports a stall (datasheet rev. 1.09, sections 5.3 and 11), and an end stop
//! at which a motor loses its steps.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panic")]

use vergence_control::{RigIo, StepSchedule};
use vergence_plant::{Plant, StopMechanics, Tmc2209, bench_mechanics};
use vergence_protocol::Microseconds;

const GCONF: u8 = 0x00;
const TSTEP: u8 = 0x12;
const TPWMTHRS: u8 = 0x13;
const TCOOLTHRS: u8 = 0x14;
const SGTHRS: u8 = 0x40;
const SG_RESULT: u8 = 0x41;
/// Microsteps by register, and StealthChop; then SpreadCycle.
const STEALTH: u32 = 1 << 6 | 1 << 7 | 1 << 8;
const SPREAD: u32 = STEALTH | 1 << 2;
/// Microseconds between two of eight microsteps at 4000 full steps a second: the speed of homing of the bench.
const STEP_NS: u64 = 31_250;

fn crc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc, |crc: u8, bit| crc << 1 ^ if (crc >> 7) ^ (byte >> bit & 1) == 1 { 7 } else { 0 })
    })
}

fn say(plant: &mut Plant, body: &[u8]) -> Option<[u8; 8]> {
    let datagram: Vec<u8> = body.iter().copied().chain([crc(body)]).collect();
    plant.drivers_mut().hear(&datagram).map(|reply| reply.bytes)
}

fn write(plant: &mut Plant, register: u8, value: u32) {
    let [a, b, c, d] = value.to_be_bytes();
    say(plant, &[5, 0, register | 0x80, a, b, c, d]);
}

fn read(plant: &mut Plant, register: u8) -> u32 {
    let reply = say(plant, &[5, 0, register]).expect("an answer");
    u32::from_be_bytes(reply[3..7].try_into().unwrap())
}

/// The baseline with a driver at eight microsteps, 20 mm before a stop that yields.
fn plant() -> Plant {
    let mut mechanics = bench_mechanics();
    mechanics[0].end_stops[0] = 60_000.0;
    mechanics[0].stop = StopMechanics { give: 30.0, fall_back: 40.0 };
    let mut plant = Plant::new(&mechanics, &[80_000.0, 0.0]);
    plant.drivers_mut().attach(0, 8);
    plant.wire_diag(0);
    for (register, value) in [(GCONF, STEALTH), (0x6C, 5 << 24 | 3), (TCOOLTHRS, 15), (SGTHRS, 50)] {
        write(&mut plant, register, value);
    }
    plant.set_drivers(true);
    plant
}

/// Goes down for so many milliseconds, with a step each `every_ns`.
fn run(plant: &mut Plant, from_ms: u64, ms: u64, every_ns: u64) {
    let mut at = from_ms * 1_000_000;
    for tick in from_ms..from_ms + ms {
        let mut steps = StepSchedule { start: Microseconds(tick * 1000), forward: false, ..StepSchedule::default() };
        while at < (tick + 1) * 1_000_000 {
            steps.at_ns.push((at - tick * 1_000_000) as u32).unwrap();
            at += every_ns;
        }
        plant.schedule_steps(0, &steps);
        plant.advance(Microseconds((tick + 1) * 1000));
    }
}

fn diag(plant: &Plant) -> bool {
    let chip = plant.drivers().chip(0).is_some_and(Tmc2209::diag);
    assert_eq!(chip, !plant.home_switch(0), "the line follows the output");
    chip
}

#[test]
fn tstep_is_the_time_of_a_256th_of_a_full_step_in_clocks_of_12_mhz() {
    for (every_ns, tstep) in [(STEP_NS, 11), (125_000, 46), (1_000_000, 375)] {
        let mut plant = plant();
        run(&mut plant, 1, 20, every_ns);
        assert_eq!(read(&mut plant, TSTEP), tstep, "{every_ns}");
    }
    let mut plant = plant();
    plant.advance(Microseconds(200_000_000));
    assert_eq!(read(&mut plant, TSTEP), (1 << 20) - 1);
}

#[test]
fn a_free_motor_gives_more_than_a_held_one_and_more_the_faster_it_turns() {
    let mut plant = plant();
    run(&mut plant, 1, 100, STEP_NS);
    let free = read(&mut plant, SG_RESULT);
    assert!(!diag(&plant) && free > 100 && free.is_multiple_of(2), "{free}");
    run(&mut plant, 101, 500, STEP_NS);
    let held = read(&mut plant, SG_RESULT);
    assert!(diag(&plant) && held <= 100, "{held}");
    let load = plant.load(0).unwrap();
    assert!((59_929.0..=60_010.0).contains(&load), "pressed, or fallen back by four full steps: {load}");
    let mut slow = self::plant();
    run(&mut slow, 1, 100, 4 * STEP_NS);
    assert!(read(&mut slow, SG_RESULT) < free);
}

/// Each condition of the datasheet, on a motor that is held.
#[test]
fn a_stall_is_reported_under_the_conditions_of_the_datasheet_only() {
    for (register, value, reported) in [
        (SGTHRS, 50, true),
        (SGTHRS, 21, true), // SG_RESULT of 42 is not above.
        (SGTHRS, 20, false),
        (TCOOLTHRS, 11, true), // Not slower than the motor turns.
        (TCOOLTHRS, 10, false),
        (TCOOLTHRS, 0, false),
        (TPWMTHRS, 10, true),
        (TPWMTHRS, 11, false), // The motor turns faster than StealthChop goes.
        (GCONF, SPREAD, false),
    ] {
        let mut plant = plant();
        run(&mut plant, 1, 600, STEP_NS);
        assert_eq!((read(&mut plant, TSTEP), read(&mut plant, SG_RESULT)), (11, 42));
        write(&mut plant, register, value);
        assert_eq!(diag(&plant), reported, "{register:02x} = {value}");
    }
    let mut plant = plant();
    run(&mut plant, 1, 600, STEP_NS);
    plant.set_drivers(false);
    assert!(!diag(&plant), "a motor without current stalls nowhere");
}

#[test]
fn a_driver_error_is_shown_too() {
    let mut plant = plant();
    assert!(!diag(&plant), "at rest");
    plant.drivers_mut().chip_mut(0).unwrap().heat(150.0);
    assert!(diag(&plant));
}
