//! `vergence servo` on simulated servos behind a pseudo-terminal: a lab numbers the servos of its robot one after the other.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "a peer talks in real time")]

mod common;

use std::process::{Command, Output};

use common::servo_line::ServoLine;
use serde_json::Value;
use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{Id, encode, table};
use vergence_plant::servo::{Free, Master, Nanoseconds, Servo, ServoBus, ServoModel};

fn bus(servos: &[(u8, Baud)]) -> ServoBus<Free> {
    let servo = |&(number, baud): &(u8, Baud)| {
        Servo::new(ServoModel::XM430_W350, Id::servo(number).unwrap(), baud, std::f64::consts::PI)
    };
    ServoBus::new(servos.iter().map(servo).collect(), Free::default())
}

fn run(line: &ServoLine, arguments: &[&str]) -> Output {
    let vergence = env!("CARGO_BIN_EXE_vergence");
    Command::new(vergence).args(["--json", "servo"]).args(arguments).args(["--adapter", &line.name]).output().unwrap()
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refused(output: &Output, code: i32, part: &str) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(text.contains(part), "{text}");
}

#[test]
fn a_new_servo_gets_its_number_and_speed() {
    let line = ServoLine::serve(bus(&[(13, Baud::M1), (1, Baud::B57600)]));
    let all = json(&run(&line, &["scan"]));
    let found: Vec<(u64, u64)> = all["servos"]
        .as_array()
        .unwrap()
        .iter()
        .map(|servo| (servo["id"].as_u64().unwrap(), servo["baud"].as_u64().unwrap()))
        .collect();
    assert_eq!(found, [(1, 57_600), (13, 1_000_000)]);
    assert_eq!(all["servos"][0]["kind"], "XM430-W350");

    json(&run(&line, &["set-baud", "1", "1000000", "--baud", "57600"]));
    json(&run(&line, &["set-id", "1", "14"]));
    let all = json(&run(&line, &["scan", "--baud", "1000000"]));
    assert_eq!((&all["servos"][0]["id"], &all["servos"][1]["id"]), (&13.into(), &14.into()));
    let bus = line.take_back();
    assert_eq!(bus.servos()[1].registers().get(&table::ID), 14);
}

#[test]
fn what_would_harm_is_refused_with_its_reason() {
    let line = ServoLine::serve(bus(&[(13, Baud::M1), (14, Baud::M1)]));
    refused(&run(&line, &["set-id", "13", "14"]), 1, "number 14 is taken");
    refused(&run(&line, &["set-id", "7", "15"]), 3, "servo 7 does not answer at 1000000 bit/s");
    refused(&run(&line, &["set-id", "13", "253"]), 2, "253 is no number of a servo");
    refused(&run(&line, &["set-baud", "13", "31250"]), 2, "no speed of a servo");
    drop(line.take_back());

    let mut armed = bus(&[(13, Baud::M1)]);
    let torque = encode::write(Id::servo(13).unwrap(), table::TORQUE_ENABLE.address, &[1]).unwrap();
    Master::new(1_000_000).ask(&mut armed, &torque, Nanoseconds::microseconds(2_000));
    let line = ServoLine::serve(armed);
    refused(&run(&line, &["set-id", "13", "15"]), 1, "has torque on");
    refused(&run(&line, &["test", "13", "--move"]), 1, "has torque on");
    drop(line.take_back());

    let line = ServoLine::serve(bus(&[(1, Baud::M1), (1, Baud::M1)]));
    refused(&run(&line, &["set-id", "1", "13"]), 1, "two servos have one number");
    refused(&run(&line, &["scan", "--baud", "1000000"]), 1, "two servos have one number");
    drop(line.take_back());
}

#[test]
fn a_test_tells_how_a_servo_is_and_moves_only_where_asked() {
    let line = ServoLine::serve(bus(&[(15, Baud::M1)]));
    let told = json(&run(&line, &["test", "15"]));
    assert_eq!((&told["model"], &told["hardware_errors"], &told["torque"]), (&1020.into(), &0.into(), &false.into()));
    assert!((told["volts"].as_f64().unwrap() - 12.0).abs() < 0.2 && told["swing_error_deg"].is_null(), "{told}");
    assert!((told["position_deg"].as_f64().unwrap() - 180.0).abs() < 0.2, "{told}");
    let swung = json(&run(&line, &["test", "15", "--move"]));
    for error in swung["swing_error_deg"].as_array().unwrap() {
        assert!(error.as_f64().unwrap().abs() < 1.0, "{swung}");
    }
    let bus = line.take_back();
    assert!(!bus.servos()[0].has_torque(), "it is let go");
    assert!((bus.servos()[0].motor().output().to_degrees() - 180.0).abs() < 1.5);

    let mut hot = self::bus(&[(15, Baud::M1)]);
    hot.servo_mut(Id::servo(15).unwrap()).unwrap().motor_mut().set_temperature(95.0);
    let line = ServoLine::serve(hot);
    // Its own watch needs a moment.
    refused(&run(&line, &["test", "15"]), 1, "errors of its hardware");
    drop(line.take_back());
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    let vergence = env!("CARGO_BIN_EXE_vergence");
    let output = Command::new(vergence).args(["servo", "scan", "--adapter", "/dev/none"]).output().unwrap();
    refused(&output, 3, "/dev/none");
}
