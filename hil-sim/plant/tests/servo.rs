//! Simulated servos: what they answer, when, and how they move.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use vergence_dynamixel::table::{self, Register};
use vergence_dynamixel::units::{Baud, HardwareErrors, OperatingMode};
use vergence_dynamixel::{BulkItem, FastBlocks, Id, Receiver, ResetScope, Status, StatusError, encode};
use vergence_plant::servo::{Drive, Free, Master, Motor, Nanoseconds, Servo, ServoBus, ServoModel};

const MODEL: ServoModel = ServoModel::XM430_W350;
const SOON: Nanoseconds = Nanoseconds::microseconds(1_000);
const COUNT: f64 = std::f64::consts::TAU / 4096.0;

struct Bench {
    bus: ServoBus<Free>,
    master: Master,
}

fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

/// Servos 13 to 17 at 1 Mbit/s, standing at half a turn.
fn bench() -> Bench {
    let servos = (13..18).map(|number| Servo::new(MODEL, id(number), Baud::M1, 2048.5 * COUNT)).collect();
    Bench { bus: ServoBus::new(servos, Free::default()), master: Master::new(1_000_000) }
}

/// Error and data of an answer.
type Answer = Option<(Option<StatusError>, Vec<u8>)>;

impl Bench {
    fn ask(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.master.ask(&mut self.bus, bytes, SOON)
    }

    fn wait(&mut self, ms: u64) {
        self.master.listen(&mut self.bus, Nanoseconds::microseconds(1_000 * ms));
    }

    fn write(&mut self, to: Id, register: &Register, value: i64) -> Answer {
        let bytes = value.to_le_bytes();
        let packet = encode::write(to, register.address, &bytes[..usize::from(register.width)]).unwrap();
        answers(&self.ask(&packet)).pop().map(|(_, _, error, data)| (error, data))
    }

    fn set(&mut self, to: Id, register: &Register, value: i64) {
        assert_eq!(self.write(to, register, value), Some((None, vec![])), "{}", register.name);
    }

    fn get(&mut self, of: Id, register: &Register) -> i64 {
        let heard = self.ask(&encode::read(of, register.address, register.width).unwrap());
        let (_, _, error, data) = answers(&heard).pop().unwrap();
        assert_eq!(error, None);
        let mut bytes = [if register.signed && data.last().is_some_and(|byte| byte & 0x80 != 0) { 0xFF } else { 0 }; 8];
        bytes[..data.len()].copy_from_slice(&data);
        i64::from_le_bytes(bytes)
    }
}

/// Number, alert, error and data of each answer.
fn answers(heard: &[u8]) -> Vec<(u8, bool, Option<StatusError>, Vec<u8>)> {
    let mut receiver = Receiver::default();
    let mut found = Vec::new();
    let mut rest = heard;
    while !rest.is_empty() {
        rest = receiver.hear(rest);
        while let Some(packet) = receiver.next_packet() {
            if let Ok(Status { id, alert, error, data }) = Status::of(&packet) {
                found.push((id.get(), alert, error, data.to_vec()));
            }
        }
    }
    found
}

fn numbers(heard: &[u8]) -> Vec<u8> {
    answers(heard).into_iter().map(|(id, ..)| id).collect()
}

#[test]
fn it_answers_after_its_return_delay() {
    let mut bench = bench();
    for (delay, us) in [(250, 500), (0, 0), (10, 20)] {
        bench.set(id(13), &table::RETURN_DELAY_TIME, delay);
        let question = encode::ping(id(13)).unwrap();
        for &byte in &question {
            bench.master.now = bench.master.now.plus(Nanoseconds::of_bytes(1, 1_000_000));
            bench.bus.receive(bench.master.now, byte, 1_000_000);
        }
        assert_eq!(bench.bus.next_event().unwrap().0 - bench.master.now.0, us * 1_000);
        let heard = bench.master.listen(&mut bench.bus, SOON);
        assert_eq!(answers(&heard), [(13, false, None, vec![0xFC, 0x03, 46])], "model 1020");
    }
}

#[test]
fn reads_of_several_come_in_the_order_asked() {
    let mut bench = bench();
    let order = [15, 13, 17, 14, 16].map(id);
    let heard = bench.ask(&encode::sync_read(132, 4, &order).unwrap());
    assert_eq!(numbers(&heard), [15, 13, 17, 14, 16]);
    assert!(answers(&heard).iter().all(|(.., data)| data[..] == 2048_u32.to_le_bytes()));
    let items = [(14, 146, 1), (13, 132, 4)].map(|(id, address, length)| BulkItem { id, address, length, data: &[] });
    let heard = bench.ask(&encode::bulk_read(&items).unwrap());
    assert_eq!(
        answers(&heard).into_iter().map(|(id, .., data)| (id, data.len())).collect::<Vec<_>>(),
        [(14, 1), (13, 4)]
    );

    let heard = bench.ask(&encode::fast_sync_read(132, 4, &order).unwrap());
    let mut receiver = Receiver::default();
    receiver.hear(&heard);
    let packet = receiver.next_packet().unwrap();
    let expected = order.map(|id| (id, 4));
    let blocks: Vec<_> = FastBlocks::of(&packet, &expected).unwrap().map(|block| block.unwrap().data).collect();
    assert_eq!(blocks, [&2048_u32.to_le_bytes()[..]; 5]);
}

#[test]
fn a_fast_read_of_five_takes_less_than_a_cycle_of_250_hz() {
    let mut bench = bench();
    for number in 13..18 {
        bench.set(id(number), &table::RETURN_DELAY_TIME, 0);
    }
    let start = bench.master.now;
    // Current, velocity and position: 10 bytes each.
    bench.master.ask(
        &mut bench.bus,
        &encode::fast_sync_read(126, 10, &[13, 14, 15, 16, 17].map(id)).unwrap(),
        Nanoseconds(0),
    );
    let took = (bench.master.now.0 - start.0) / 1_000;
    // 19 bytes asked, 78 answered, of 10 us each.
    assert_eq!(took, 970);
}

#[test]
fn a_silent_servo_silences_those_behind_it() {
    let mut bench = bench();
    bench.bus.servo_mut(id(14)).unwrap().faults_mut().is_silent = true;
    let order = [13, 14, 15].map(id);
    assert_eq!(numbers(&bench.ask(&encode::sync_read(132, 4, &order).unwrap())), [13]);
    let heard = bench.ask(&encode::fast_sync_read(132, 4, &order).unwrap());
    assert_eq!(heard.len(), 16, "the first block only");
    assert_eq!(numbers(&bench.ask(&encode::ping(Id::BROADCAST).unwrap())), [], "each has its slot");
    bench.wait(50);
    let mut heard = bench.ask(&encode::ping(Id::BROADCAST).unwrap());
    heard.extend(bench.master.listen(&mut bench.bus, Nanoseconds::microseconds(50_000)));
    assert_eq!(numbers(&heard), [13, 15, 16, 17]);
}

#[test]
fn two_of_one_number_damage_each_other() {
    let servos = [1.0, 2.0].map(|angle| Servo::new(MODEL, id(1), Baud::M1, angle));
    let mut bus = ServoBus::new(servos.to_vec(), Free::default());
    let mut master = Master::new(1_000_000);
    let heard = master.ask(&mut bus, &encode::read(id(1), 132, 4).unwrap(), SOON);
    assert!(!heard.is_empty() && answers(&heard).is_empty());
}

#[test]
fn another_speed_is_garbage_in_both_directions() {
    let mut bench = bench();
    bench.master.baud = 2_000_000;
    assert!(bench.ask(&encode::ping(id(13)).unwrap()).is_empty());
    bench.master.baud = 1_000_000;
    bench.wait(1);
    // The answer to a change of speed still has the old one.
    bench.set(id(13), &table::BAUD_RATE, i64::from(Baud::M2.register()));
    assert!(bench.ask(&encode::ping(id(13)).unwrap()).is_empty());
    bench.wait(1);
    bench.master.baud = 2_000_000;
    assert_eq!(numbers(&bench.ask(&encode::ping(id(13)).unwrap())), [13]);
}

#[test]
fn registers_refuse_as_the_manual_says() {
    let mut bench = bench();
    let servo = id(13);
    let mut refused = |register: &Register, value, error| {
        assert_eq!(bench.write(servo, register, value), Some((Some(error), vec![])), "{} {value}", register.name);
    };
    refused(&table::PRESENT_POSITION, 5, StatusError::Access);
    refused(&table::ID, 253, StatusError::DataRange);
    refused(&table::OPERATING_MODE, 2, StatusError::DataRange);
    refused(&table::GOAL_POSITION, 4_096, StatusError::DataLimit);
    refused(&table::GOAL_CURRENT, 1_194, StatusError::DataRange);
    let short = encode::write(servo, table::GOAL_POSITION.address, &[1, 2]).unwrap();
    assert_eq!(answers(&bench.ask(&short))[0].2, Some(StatusError::DataLength));
    let gap = encode::write(servo, 14, &[1]).unwrap();
    assert_eq!(answers(&bench.ask(&gap))[0].2, Some(StatusError::Access));
    let unknown = encode::raw(servo, 0x77, &[]).unwrap();
    assert_eq!(answers(&bench.ask(&unknown))[0].2, Some(StatusError::Instruction));
    assert_eq!(answers(&bench.ask(&encode::action(servo).unwrap()))[0].2, Some(StatusError::Instruction));
    bench.set(servo, &table::TORQUE_ENABLE, 1);
    assert_eq!(bench.write(servo, &table::RETURN_DELAY_TIME, 5), Some((Some(StatusError::Access), vec![])));
}

#[test]
fn it_answers_as_its_status_return_level_says() {
    let mut bench = bench();
    bench.set(id(13), &table::STATUS_RETURN_LEVEL, 1);
    assert_eq!(bench.write(id(13), &table::LED, 1), None);
    assert_eq!(bench.get(id(13), &table::LED), 1);
    bench.write(id(13), &table::STATUS_RETURN_LEVEL, 0);
    assert!(bench.ask(&encode::read(id(13), 65, 1).unwrap()).is_empty());
    assert_eq!(numbers(&bench.ask(&encode::ping(id(13)).unwrap())), [13]);
}

#[test]
fn a_registered_write_waits_for_its_action() {
    let mut bench = bench();
    bench.ask(&encode::reg_write(id(13), table::LED.address, &[1]).unwrap());
    assert_eq!((bench.get(id(13), &table::LED), bench.get(id(13), &table::REGISTERED_INSTRUCTION)), (0, 1));
    bench.ask(&encode::action(Id::BROADCAST).unwrap());
    assert_eq!((bench.get(id(13), &table::LED), bench.get(id(13), &table::REGISTERED_INSTRUCTION)), (1, 0));
}

#[test]
fn a_reset_keeps_what_it_was_told_to() {
    let mut bench = bench();
    bench.set(id(13), &table::TEMPERATURE_LIMIT, 60);
    bench.ask(&encode::factory_reset(id(13), ResetScope::ExceptIdAndBaud).unwrap());
    assert!(bench.ask(&encode::ping(id(13)).unwrap()).is_empty(), "it starts");
    bench.wait(400);
    assert_eq!(bench.get(id(13), &table::TEMPERATURE_LIMIT), 80);
}

#[test]
fn indirect_registers_stand_for_others() {
    let mut bench = bench();
    for (number, address) in (1..).zip([132, 133, 134, 135, 146]) {
        bench.set(id(13), &table::indirect_address(number).unwrap(), address);
    }
    let heard = bench.ask(&encode::read(id(13), 224, 5).unwrap());
    assert_eq!(answers(&heard)[0].3, [0, 8, 0, 0, 25]);
    bench.set(id(13), &table::indirect_address(6).unwrap(), i64::from(table::LED.address));
    bench.set(id(13), &table::indirect_data(6).unwrap(), 1);
    assert_eq!(bench.get(id(13), &table::LED), 1);
}

/// Goes to a goal with a profile, in extended position mode with an integral gain.
fn go(bench: &mut Bench, servo: Id, goal: i64) {
    bench.set(servo, &table::OPERATING_MODE, i64::from(OperatingMode::ExtendedPosition.register()));
    bench.set(servo, &table::POSITION_I_GAIN, 1_000);
    bench.set(servo, &table::PROFILE_VELOCITY, 60);
    bench.set(servo, &table::PROFILE_ACCELERATION, 20);
    bench.set(servo, &table::TORQUE_ENABLE, 1);
    bench.set(servo, &table::GOAL_POSITION, goal);
}

#[test]
fn it_reaches_its_goal_under_load() {
    let mut bench = bench();
    bench.bus.mechanism_mut().loads = vec![-1.0];
    go(&mut bench, id(13), 3_072);
    bench.wait(400);
    let velocity = bench.get(id(13), &table::PRESENT_VELOCITY);
    assert!((55..=70).contains(&velocity), "60 of the profile, and what the integral catches up: {velocity}");
    // 90 degrees at 60 units are 1.1 s.
    bench.wait(4_000);
    let position = bench.get(id(13), &table::PRESENT_POSITION);
    assert!((position - 3_072).abs() <= 2, "{position}");
    // 1 N m needs 1 N m / (4.1 N m / 2.3 A) = 0.56 A, less what the friction holds.
    let current = bench.get(id(13), &table::PRESENT_CURRENT) as f64 * 2.69e-3;
    assert!((0.5..0.6).contains(&current), "{current}");
    bench.bus.mechanism_mut().loads = vec![];
}

#[test]
fn it_runs_and_stalls_as_its_data_sheet_says() {
    let mut bench = bench();
    let servo = id(13);
    bench.set(servo, &table::OPERATING_MODE, i64::from(OperatingMode::Pwm.register()));
    bench.set(servo, &table::TORQUE_ENABLE, 1);
    bench.set(servo, &table::GOAL_PWM, 885);
    bench.wait(300);
    let revolutions = bench.get(servo, &table::PRESENT_VELOCITY) as f64 * 0.229;
    assert!((revolutions - 46.0).abs() < 0.5, "46 rev/min at 12 V without load: {revolutions}");
    bench.bus.servo_mut(servo).unwrap().motor_mut().blocked = true;
    bench.wait(300);
    let amperes = bench.get(servo, &table::PRESENT_CURRENT) as f64 * 2.69e-3;
    assert!((amperes - 2.3).abs() < 0.01, "2.3 A in stall: {amperes}");
}

#[test]
fn a_blocked_servo_reports_overload_and_lets_go_until_a_reboot() {
    let mut bench = bench();
    let servo = id(13);
    go(&mut bench, servo, 2_048);
    bench.bus.servo_mut(servo).unwrap().motor_mut().blocked = true;
    bench.set(servo, &table::GOAL_POSITION, 3_000);
    bench.wait(900);
    assert_eq!(bench.get(servo, &table::TORQUE_ENABLE), 1, "a second of too large a load is allowed");
    bench.wait(1_000);
    assert_eq!(bench.get(servo, &table::HARDWARE_ERROR_STATUS), i64::from(HardwareErrors::OVERLOAD.0));
    assert_eq!(bench.get(servo, &table::TORQUE_ENABLE), 0);
    assert!(answers(&bench.ask(&encode::ping(servo).unwrap()))[0].1, "the alert");
    assert_eq!(bench.write(servo, &table::TORQUE_ENABLE, 1), Some((Some(StatusError::ResultFail), vec![])));
    bench.ask(&encode::reboot(servo).unwrap());
    bench.wait(400);
    assert_eq!(bench.get(servo, &table::HARDWARE_ERROR_STATUS), 0);
    bench.set(servo, &table::TORQUE_ENABLE, 1);
}

#[test]
fn the_goal_current_limits_the_torque_of_current_based_position() {
    let mut bench = bench();
    let servo = id(13);
    bench.set(servo, &table::OPERATING_MODE, i64::from(OperatingMode::CurrentBasedPosition.register()));
    bench.set(servo, &table::GOAL_CURRENT, 200);
    bench.set(servo, &table::TORQUE_ENABLE, 1);
    bench.bus.servo_mut(servo).unwrap().motor_mut().blocked = true;
    bench.set(servo, &table::GOAL_POSITION, 3_000);
    bench.wait(3_000);
    assert_eq!(bench.get(servo, &table::PRESENT_CURRENT), 200);
    assert_eq!(bench.get(servo, &table::HARDWARE_ERROR_STATUS), 0);
    // 0.54 A in 5.2 Ohm are 1.5 W.
    assert!((25..=26).contains(&bench.get(servo, &table::PRESENT_TEMPERATURE)));
}

#[test]
fn it_overheats_and_notices_a_wrong_supply_and_a_broken_encoder() {
    let mut bench = bench();
    go(&mut bench, id(13), 2_048);
    bench.bus.servo_mut(id(13)).unwrap().motor_mut().set_temperature(85.0);
    bench.wait(10);
    assert_eq!(bench.get(id(13), &table::HARDWARE_ERROR_STATUS), i64::from(HardwareErrors::OVERHEATING.0));
    assert_eq!(bench.get(id(13), &table::TORQUE_ENABLE), 0);
    let now = bench.master.now;
    bench.bus.servo_mut(id(14)).unwrap().set_supply(9.0, now);
    bench.wait(10);
    assert_eq!(bench.get(id(14), &table::HARDWARE_ERROR_STATUS), i64::from(HardwareErrors::INPUT_VOLTAGE.0));
    bench.bus.servo_mut(id(15)).unwrap().faults_mut().encoder_broken = true;
    bench.wait(10);
    assert_eq!(bench.get(id(15), &table::HARDWARE_ERROR_STATUS), i64::from(HardwareErrors::ENCODER.0));
}

#[test]
fn the_bus_watchdog_stops_it_and_locks_the_goals() {
    let mut bench = bench();
    let servo = id(13);
    go(&mut bench, servo, 20_000);
    bench.set(servo, &table::BUS_WATCHDOG, 5);
    bench.wait(80);
    assert_eq!(bench.get(servo, &table::BUS_WATCHDOG), 5);
    bench.wait(105);
    assert_eq!(bench.get(servo, &table::BUS_WATCHDOG), -1);
    bench.wait(300);
    let stood = bench.get(servo, &table::PRESENT_POSITION);
    bench.wait(300);
    assert!((bench.get(servo, &table::PRESENT_POSITION) - stood).abs() <= 1, "it stands");
    assert_eq!(bench.write(servo, &table::GOAL_POSITION, 3_000), Some((Some(StatusError::DataRange), vec![])));
    bench.set(servo, &table::BUS_WATCHDOG, 0);
    bench.set(servo, &table::GOAL_POSITION, 3_000);
}

#[test]
fn without_power_it_is_silent_and_forgets_its_ram() {
    let mut bench = bench();
    bench.set(id(13), &table::TEMPERATURE_LIMIT, 70);
    go(&mut bench, id(13), 2_500);
    let now = bench.master.now;
    bench.bus.set_supply(0.0, now);
    assert!(bench.ask(&encode::ping(id(13)).unwrap()).is_empty());
    let now = bench.master.now;
    bench.bus.set_supply(12.0, now);
    bench.wait(400);
    assert_eq!((bench.get(id(13), &table::TORQUE_ENABLE), bench.get(id(13), &table::PROFILE_VELOCITY)), (0, 0));
    assert_eq!(bench.get(id(13), &table::TEMPERATURE_LIMIT), 70);
}

#[test]
fn faults_of_the_line_are_used_up() {
    let mut bench = bench();
    let ping = encode::ping(id(13)).unwrap();
    let faults = |bench: &mut Bench| *bench.bus.servo_mut(id(13)).unwrap().faults_mut();
    bench.bus.servo_mut(id(13)).unwrap().faults_mut().flipped_answers = 1;
    assert!(answers(&bench.ask(&ping)).is_empty());
    bench.bus.servo_mut(id(13)).unwrap().faults_mut().wrong_ids = 1;
    assert_eq!(numbers(&bench.ask(&ping)), [14]);
    bench.bus.servo_mut(id(13)).unwrap().faults_mut().lost_answers = 1;
    assert!(bench.ask(&ping).is_empty());
    bench.bus.servo_mut(id(13)).unwrap().faults_mut().lost_instructions = 1;
    assert!(bench.ask(&ping).is_empty());
    assert_eq!(numbers(&bench.ask(&ping)), [13]);
    assert_eq!(faults(&mut bench), Default::default());
}

#[test]
fn the_output_hangs_in_its_play_on_the_side_of_the_load() {
    // A load that the friction of the gears holds moves the output through the play, and no further.
    let ends = [0.04, -0.04].map(|load| {
        let mut motor = Motor::new(MODEL, 1.0);
        (0..400).for_each(|_| motor.step(2.5e-4, Drive::Open, load));
        motor.output()
    });
    assert!((ends[0] - ends[1] - MODEL.backlash).abs() < 1e-6, "{ends:?}");
}
