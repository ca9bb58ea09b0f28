//! A robot on the unmodified firmware: five simulated servos on the bus of the simulated chip, with the laws of every axis and the
//! faults of their bus. The stories of the native board (`hil-sim/plant/tests/joints.rs`), and times by the chip's clock.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;
#[path = "elf_rig/robot.rs"]
mod robot;

use elf_rig::Conversation;
use robot::{ALL, IDS, Robot, become_robot, degrees, restart, servos_on_a_board, spider, stick_bug};
use vergence_dynamixel::Receiver;
use vergence_dynamixel::units::Baud;
use vergence_mcu::{Bench, Machine, Picoseconds, SentByte, UartId};
use vergence_plant::servo::Servo;
use vergence_protocol::{
    ControllerState, DriverState, FaultCode, Microseconds, Refusal, Request, SettingItem, SettingKey, Status, StopKind,
    Trigger,
};

const CORE_HZ: u64 = 170_000_000;
/// The interrupts of TIM7 (line 55), which runs the node, and of USART3 (line 39), which runs the bus.
const TICK_EXCEPTION: u16 = 16 + 55;
const BUS_EXCEPTION: u16 = 16 + 39;
/// Instructions of the protocol.
const SYNC_WRITE: u8 = 0x83;
const FAST_SYNC_READ: u8 = 0x8A;

/// The instructions in what was said, each with the end of its last byte.
fn instructions(said: &[SentByte]) -> Vec<(Picoseconds, u8)> {
    let mut receiver = Receiver::default();
    let mut found = Vec::new();
    for sent in said {
        receiver.hear(&[sent.byte]);
        while let Some(packet) = receiver.next_packet() {
            found.push((sent.at, packet.instruction));
        }
    }
    assert_eq!(receiver.counters().crc_errors, 0, "each packet is sound");
    found
}

#[test]
fn a_board_of_a_bench_says_nothing_on_the_bus() {
    let mut talk = Conversation::with_board(servos_on_a_board(Baud::M1), Microseconds(0));
    talk.connect();
    talk.wait(300_000);
    assert!(talk.board.machine.chip_mut().take_sent(UartId::USART3).is_empty());
    become_robot(&mut talk);
    talk.wait(100_000);
    let said = talk.board.machine.chip_mut().take_sent(UartId::USART3);
    assert!(!said.is_empty());
    assert!(said.iter().all(|sent| sent.baud.abs_diff(1_000_000) < 1_000), "{}", said[0].baud);
}

#[test]
fn five_joints_move_together_and_settle() {
    let mut robot = Robot::at(spider());
    let time = robot.goes(stick_bug());
    assert!(time < 4_000_000, "{time} us");
    for (output, target) in robot.outputs().into_iter().zip([170.0, 170.0, 20.0, 180.0, 180.0]) {
        assert!((output - target).abs() < 0.5, "{:?}", robot.outputs());
    }
}

/// Exchanges on the wire, each with the goals of all joints and the positions of all.
#[test]
fn round_trips_of_five_joints_are_faster_than_250_a_second_at_1_mbit_s() {
    let mut robot = Robot::at(spider());
    for (what, moves) in [("at rest", false), ("in a move", true)] {
        if moves {
            robot.begins(stick_bug());
            robot.talk.wait(100_000);
        }
        robot.said();
        robot.talk.wait(500_000);
        let said = instructions(&robot.said());
        let count = |wanted| said.iter().filter(|(_, instruction)| *instruction == wanted).count() as u64 * 2;
        let reads: Vec<u64> =
            said.iter().filter(|(_, one)| *one == FAST_SYNC_READ).map(|(at, _)| at.0 / 1_000_000).collect();
        let longest = reads.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0);
        println!(
            "{what}: {} reads and {} writes of all joints a second, {longest} us at most from one read to the next",
            count(FAST_SYNC_READ),
            count(SYNC_WRITE)
        );
        assert!(count(FAST_SYNC_READ) >= 250 && count(SYNC_WRITE) >= 250 && longest < 6_000);
    }
    assert!(robot.talk.faults.is_empty(), "{:?}", robot.talk.faults);
}

/// From the pin's edge to the last servo without torque.
#[test]
fn the_emergency_stop_switches_torque_off() {
    let mut robot = Robot::at(spider());
    robot.begins(stick_bug());
    robot.talk.wait(500_000);
    let mut worst = 0;
    for place in 0..40 {
        let mut machine = robot.talk.board.machine.clone();
        machine.run_for(Picoseconds::microseconds(place * 370));
        machine.chip_mut().with_world(|bench, _| bench.plant_mut().press_emergency_stop(true));
        let begin = machine.time();
        let on = |machine: &Machine<Bench>| {
            machine.chip().world().plant().joints().servos().servos().iter().any(Servo::has_torque)
        };
        let mut us = 0;
        while on(&machine) {
            us += 100;
            machine.run_until(begin + Picoseconds::microseconds(us));
            assert!(us < 20_000, "torque stays on");
        }
        worst = worst.max(us);
    }
    println!("from the emergency stop to the last joint without torque: {worst} us at most");
    assert!(worst <= 5_000, "{worst} us");
    robot.talk.board.machine.chip_mut().with_world(|bench, _| bench.plant_mut().press_emergency_stop(true));
    robot.talk.wait_for(ControllerState::Fault);
    assert_eq!(robot.talk.fault().code, FaultCode::EmergencyStop);
    assert_eq!(robot.torques(), [false; 5]);
}

#[test]
fn the_node_s_tick_stays_below_half_of_its_period() {
    let mut robot = Robot::at(spider());
    let machine = &mut robot.talk.board.machine;
    let (begun, asleep) = (machine.cpu().now(), machine.cpu().asleep());
    machine.time_handlers();
    assert_eq!(robot.talk.ask(Request::SetStream { period_us: 1_000 }), Status::Accepted);
    robot.goes(stick_bug());
    robot.begins(spider());
    robot.talk.wait(500_000);
    assert_eq!(robot.talk.ask(Request::SetTrigger(Trigger::Every { period_us: 20_000 })), Status::Accepted);
    // A new target in mid-move.
    robot.begins(stick_bug());
    robot.talk.wait(300_000);
    assert_eq!(robot.talk.ask(Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    robot.talk.wait(300_000);
    let cpu = robot.talk.board.machine.cpu();
    let elapsed = cpu.now() - begun;
    let us = |cycles: u64| cycles * 1_000_000 / CORE_HZ;
    for (what, exception) in [("node", TICK_EXCEPTION), ("bus", BUS_EXCEPTION)] {
        let time = cpu.handler_time(exception);
        println!(
            "{what}: {} runs, {} us at most, {} us with what preempts it, {:.1} % of the processor",
            time.runs,
            us(time.longest),
            us(time.longest_span),
            100.0 * time.total as f64 / elapsed as f64
        );
    }
    println!("asleep for {:.1} %", 100.0 * (cpu.asleep() - asleep) as f64 / elapsed as f64);
    assert!(cpu.handler_time(TICK_EXCEPTION).longest_span < CORE_HZ / 2_000);
    assert!(!robot.talk.marks.is_empty() && robot.talk.marks.iter().all(|mark| mark.counts.len() == 5));
}

/// The ring takes what comes while the node's tick runs, at the fastest speed of the bus.
#[test]
fn no_answer_is_lost_at_4_mbit_s() {
    let mut talk = Conversation::with_board(servos_on_a_board(Baud::M4), Microseconds(0));
    talk.connect();
    become_robot(&mut talk);
    let mut robot = Robot { talk };
    robot.talk.wait(200_000);
    let silent = DriverState::Failed(FaultCode::DriverSilent);
    assert_eq!(robot.driver(0), silent, "nobody has answered at 1 Mbit/s");
    // Of the robot's own settings, and in effect at once.
    let key = SettingKey { item: SettingItem::ServoBaud, axis: 0 };
    assert_eq!(robot.talk.ask(Request::SetSetting { key, value: 4_000_000 }), Status::Accepted);
    robot.talk.wait(500_000);
    assert_eq!(robot.said().last().map(|sent| sent.baud.abs_diff(4_000_000) < 50_000), Some(true));
    assert_eq!(robot.talk.arm(), Status::Accepted);
    robot.talk.wait_for(ControllerState::Ready);
    assert_eq!(robot.talk.ask(Request::SetStream { period_us: 1_000 }), Status::Accepted);
    robot.begins(stick_bug());
    robot.said();
    robot.talk.wait(1_000_000);
    let said = instructions(&robot.said());
    // Whoever is not understood is asked alone, after a question to each.
    let reads = said.iter().filter(|(_, one)| *one == FAST_SYNC_READ).count();
    let sync_reads = said.iter().filter(|(_, one)| *one == 0x82).count();
    println!("{reads} reads of all joints a second, {sync_reads} repeated");
    assert!(reads > 600 && sync_reads == 0, "{reads} {sync_reads}");
    robot.talk.wait_for(ControllerState::Ready);
    assert!(robot.talk.faults.is_empty(), "{:?}", robot.talk.faults);
}

#[test]
fn a_host_that_is_gone_makes_the_joints_stop_and_hold() {
    let mut robot = Robot::at(spider());
    robot.begins(stick_bug());
    robot.talk.wait(500_000);
    robot.talk.alive = false;
    robot.talk.wait(2_000_000);
    let before = robot.outputs();
    robot.talk.wait(500_000);
    assert!(robot.torques().into_iter().all(|on| on));
    assert!(robot.outputs().iter().zip(before).all(|(now, before)| (now - before).abs() < 0.2));
}

#[test]
fn the_stack_suffices_for_five_joints() {
    let mut talk = Conversation::with_board(servos_on_a_board(Baud::M1), Microseconds(0));
    talk.connect();
    become_robot(&mut talk);
    // The board tests itself.
    talk.wait(500_000);
    let mut robot = Robot { talk };
    assert_eq!(robot.talk.arm(), Status::Accepted);
    robot.talk.wait_for(ControllerState::Ready);
    robot.goes(spider());
    let spare = robot.talk.board.stack_spare();
    println!("{spare} bytes of the stack were never used");
    assert!(spare >= 8 * 1024);
}

#[test]
fn a_board_that_starts_anew_finds_its_joints_where_they_are() {
    let mut robot = Robot::at(stick_bug());
    restart(&mut robot.talk, 11);
    robot.talk.wait(500_000);
    assert_eq!(robot.talk.pose().referenced, ALL);
    assert!(robot.torques().into_iter().all(|on| !on), "the servos' watchdog or the set-up has switched torque off");
    assert_eq!(robot.talk.arm(), Status::Accepted);
    robot.goes(spider());
}

/// The servos' own watchdog stops them while the board is gone.
#[test]
fn a_board_that_loses_its_power_in_mid_move_leaves_the_joints_near_their_way() {
    let mut robot = Robot::at(spider());
    robot.begins(stick_bug());
    robot.talk.wait(600_000);
    let before = robot.outputs();
    restart(&mut robot.talk, 12);
    robot.talk.wait(500_000);
    for (now, before) in robot.outputs().iter().zip(before) {
        assert!((now - before).abs() < 6.0, "{now} {before}: the way of 0.1 s at 60 degrees a second");
    }
    assert_eq!((robot.talk.pose().referenced, robot.torques()), (ALL, [false; 5]));
    assert_eq!(robot.talk.arm(), Status::Accepted);
    robot.goes(spider());
}

#[test]
fn targets_out_of_range_are_refused() {
    let mut robot = Robot::ready();
    let beyond = degrees([120.0, 120.0, 5.0, 180.0, 180.0]);
    assert_eq!(robot.talk.move_to(beyond, 1), Status::Refused(Refusal::OutsideLimits { axis: 2 }));
}

#[test]
fn a_joint_that_drops_off_the_bus_ends_the_move_and_the_others_hold() {
    let silent = |robot: &mut Robot, is_silent| robot.with_servo(15, |servo| servo.faults_mut().is_silent = is_silent);
    let (mut robot, code) = Robot::at(spider()).disturbed(15, |robot| silent(robot, true));
    assert_eq!(code, FaultCode::DriverSilent);
    // After it is heard again, and the fault is cleared, the robot can be used.
    silent(&mut robot, false);
    assert_eq!(robot.talk.clear(), Status::Accepted);
    robot.talk.wait(1_500_000);
    assert_eq!(robot.talk.arm(), Status::Accepted, "{:?}", robot.driver(2));
    robot.goes(spider());
}

#[test]
fn an_overheated_joint_ends_the_move_and_the_others_hold() {
    let heat = |robot: &mut Robot, celsius| robot.with_servo(13, |servo| servo.motor_mut().set_temperature(celsius));
    let (mut robot, code) = Robot::at(spider()).disturbed(13, |robot| heat(robot, 95.0));
    assert_eq!(code, FaultCode::DriverOverheated);
    heat(&mut robot, 40.0);
    assert_eq!(robot.talk.clear(), Status::Accepted);
    robot.talk.wait(2_500_000);
    assert_eq!(robot.talk.arm(), Status::Accepted, "{:?}", robot.driver(0));
    robot.goes(spider());
}

#[test]
fn answers_with_wrong_crcs_end_the_move_and_the_others_hold() {
    let flip = |robot: &mut Robot| robot.with_servo(14, |servo| servo.faults_mut().flipped_answers = u32::MAX);
    let (_, code) = Robot::at(spider()).disturbed(14, flip);
    assert_eq!(code, FaultCode::DriverGarbled);
}

#[test]
fn some_disturbed_answers_do_not_end_the_move() {
    let mut robot = Robot::at(spider());
    robot.begins(stick_bug());
    for number in IDS {
        robot.talk.wait(100_000);
        robot.with_servo(number, |servo| servo.faults_mut().flipped_answers = 1);
    }
    robot.talk.wait_for(ControllerState::Ready);
    assert!(robot.talk.faults.is_empty(), "{:?}", robot.talk.faults);
}

#[test]
fn another_servo_in_its_place_ends_the_move_and_the_others_hold() {
    let rename = |robot: &mut Robot| robot.with_servo(15, |servo| servo.faults_mut().wrong_ids = u32::MAX);
    let (_, code) = Robot::at(spider()).disturbed(15, rename);
    assert_eq!(code, FaultCode::JointWrongId);
}

#[test]
fn a_servo_that_starts_anew_ends_the_move_and_the_others_hold() {
    let (_, code) = Robot::at(spider()).disturbed(16, |robot| {
        let now = robot.servo_time();
        robot.with_servo(16, |servo| {
            servo.set_supply(0.0, now);
            servo.set_supply(12.0, now);
        });
    });
    assert!([FaultCode::DriverSilent, FaultCode::DriverReset].contains(&code), "{code:?}");
}

#[test]
fn a_blocked_joint_ends_the_move_and_the_others_hold() {
    let block = |robot: &mut Robot| robot.with_servo(15, |servo| servo.motor_mut().blocked = true);
    let (robot, code) = Robot::at(spider()).disturbed(15, block);
    assert!([FaultCode::Stall, FaultCode::FollowingError, FaultCode::Slip].contains(&code), "{code:?}");
    let current = robot.servos()[2].motor().current();
    assert!(current.abs() < 0.3, "it does not press on: {current} A");
}

#[test]
fn disarmed_joints_have_no_torque() {
    let mut robot = Robot::at(spider());
    assert_eq!(robot.talk.ask(Request::Disarm), Status::Accepted);
    robot.talk.wait(20_000);
    assert!(robot.torques().into_iter().all(|on| !on));
}
