//! The master of the joints' bus against simulated servos that know nothing of it: set-up, cycles, torque, faults.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panic")]

mod joint_world;

use joint_world::{BusWorld, at, id};
use vergence_control::joints::JointFault;
use vergence_dynamixel::table;
use vergence_dynamixel::units::HardwareErrors;

#[test]
fn servos_as_from_the_factory_are_set_up() {
    let mut world = BusWorld::new();
    assert_ne!(world.servo(15).registers().get(&table::RETURN_DELAY_TIME), 0);
    let ms = world.until_ready();
    assert!(ms < 400, "{ms} ms");
    for number in 13..18 {
        let registers = world.servo(number).registers();
        assert_eq!(registers.get(&table::RETURN_DELAY_TIME), 0);
        assert_eq!(registers.get(&table::CURRENT_LIMIT), 600);
        assert_eq!(registers.get(&table::BUS_WATCHDOG), 5);
        assert_eq!(registers.get(&table::TORQUE_ENABLE), 0);
    }
    assert_eq!(world.bus.counters().timeouts, 0);
    assert!(world.bus.joints().iter().all(|joint| (joint.reading().unwrap().position.0 - 2048).abs() <= 1));
}

#[test]
fn five_joints_are_written_and_read_250_times_a_second_or_more() {
    let mut world = BusWorld::armed();
    let before = world.bus.counters();
    world.run(1_000);
    let after = world.bus.counters();
    let cycles = after.cycles - before.cycles;
    assert!(cycles >= 400, "{cycles} cycles a second");
    assert_eq!((after.timeouts, after.garbled, after.wrong_ids), (0, 0, 0));
    assert!(world.bus.joints().iter().all(|joint| joint.health().unwrap().celsius > 0));
    let ages = world.bus.joints().iter().map(|joint| world.now - joint.reading().unwrap().at.0);
    assert!(ages.max().unwrap() <= 6_000);
}

#[test]
fn servos_that_do_not_know_the_combined_answer_are_read_one_by_one() {
    let mut world = BusWorld::armed();
    world.passes_fast_reads = false;
    // Known to work, so that it is tried again each time.
    world.run(100);
    assert!(world.bus.joints().iter().all(|joint| joint.fault().is_none()));
    let mut world = BusWorld::new();
    world.passes_fast_reads = false;
    world.until_ready();
    world.bus.set_torque(true);
    world.run(50);
    let before = world.bus.counters();
    world.run(1_000);
    let after = world.bus.counters();
    assert_eq!(after.timeouts, before.timeouts, "it is given up for good");
    assert!(after.cycles - before.cycles >= 250, "{} cycles a second", after.cycles - before.cycles);
}

#[test]
fn joints_follow_their_goals() {
    let mut world = BusWorld::armed();
    for step in 0..=300 {
        for joint in 0..5 {
            world.bus.set_goal(joint, at(2048 + step));
        }
        world.run(2);
    }
    world.run(300);
    for joint in world.bus.joints() {
        assert!((joint.reading().unwrap().position.0 - 2348).abs() <= 4, "{:?}", joint.reading());
    }
}

#[test]
fn torque_is_off_within_five_milliseconds() {
    for wait in 0..40 {
        let mut world = BusWorld::armed();
        world.run(wait);
        world.bus.set_torque(false);
        world.run(5);
        assert!((13..18).all(|number| !world.servo(number).has_torque()), "after {wait} ms");
        assert!(!world.bus.torque_is_off(), "no joint is believed before it has answered");
        world.run(40);
        assert!(world.bus.torque_is_off());
    }
}

#[test]
fn torque_off_is_repeated_for_a_joint_that_did_not_hear_it() {
    let mut world = BusWorld::armed();
    world.fault(16).lost_instructions = 2;
    world.bus.set_torque(false);
    world.run(80);
    assert!((13..18).all(|number| !world.servo(number).has_torque()));
    assert!(world.bus.torque_is_off());
}

#[test]
fn a_joint_that_drops_off_has_a_fault_and_the_others_hold() {
    let mut world = BusWorld::armed();
    world.fault(15).is_silent = true;
    world.run(40);
    assert_eq!(world.faults(), [None, None, Some(JointFault::Silent), None, None]);
    let before = world.bus.counters().cycles;
    world.run(1_000);
    assert!(world.bus.counters().cycles - before >= 250);
    assert!([13, 14, 16, 17].into_iter().all(|number| world.servo(number).has_torque()));
    // Once it is heard again it is set up anew, where that is wanted.
    world.fault(15).is_silent = false;
    world.bus.set_torque(false);
    world.run(100);
    world.bus.recover();
    world.until_ready();
}

#[test]
fn disturbed_answers_cost_time_but_are_no_fault() {
    let mut world = BusWorld::armed();
    for number in 13..18 {
        world.fault(number).flipped_answers = 1;
        world.run(25);
        world.fault(number).lost_answers = 1;
        world.run(25);
    }
    assert_eq!(world.faults(), [None; 5]);
    let counters = world.bus.counters();
    // After a wrong bit in the middle of a combined answer the servos behind it keep silent.
    assert!(counters.garbled >= 1 && counters.garbled + counters.timeouts >= 10, "{counters:?}");
    assert!((13..18).all(|number| world.servo(number).has_torque()));
}

#[test]
fn a_joint_whose_answers_are_always_garbled_has_a_fault() {
    let mut world = BusWorld::armed();
    world.fault(14).flipped_answers = u32::MAX;
    world.run(40);
    assert_eq!(world.faults(), [None, Some(JointFault::Garbled), None, None, None]);
}

#[test]
fn another_servo_that_answers_is_a_fault_of_its_own() {
    let mut world = BusWorld::armed();
    world.fault(17).wrong_ids = u32::MAX;
    world.run(40);
    assert_eq!(world.faults(), [None, None, None, None, Some(JointFault::WrongId)]);
}

#[test]
fn an_overheated_joint_is_named() {
    let mut world = BusWorld::armed();
    world.servos.servo_mut(id(13)).unwrap().motor_mut().set_temperature(95.0);
    world.run(400);
    assert_eq!(world.faults()[0], Some(JointFault::Hardware(HardwareErrors::OVERHEATING)));
    assert_eq!(world.faults()[1..], [None; 4]);
    assert!((14..18).all(|number| world.servo(number).has_torque()));
}

#[test]
fn servos_stop_by_themselves_when_the_board_dies() {
    let mut world = BusWorld::armed();
    world.board_lives = false;
    world.run(150);
    assert!((13..18).all(|number| world.servo(number).registers().has_bitten()));
    // A board that comes back finds out, sets them up and has them hold again.
    world.restart_board();
    world.until_ready();
    world.bus.set_torque(true);
    world.run(60);
    assert_eq!(world.faults(), [None; 5]);
    assert!(world.bus.joints().iter().all(|joint| joint.torque() == Some(true)));
}

#[test]
fn a_servo_that_started_anew_is_noticed() {
    let mut world = BusWorld::armed();
    let now = world.instant();
    let servo = world.servos.servo_mut(id(14)).unwrap();
    servo.set_supply(0.0, now);
    world.run(3);
    let now = world.instant();
    world.servos.servo_mut(id(14)).unwrap().set_supply(12.0, now);
    world.run(900);
    assert!(matches!(world.faults()[1], Some(JointFault::Silent | JointFault::TorqueLost)), "{:?}", world.faults());
    assert!([13, 15, 16, 17].into_iter().all(|number| world.servo(number).has_torque()));
}
