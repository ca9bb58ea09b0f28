//! The maker's own library, `dynamixel-sdk` from PyPI, against this program's servos and packets.
//!
//! It talks over a pseudo-terminal to simulated servos, sends packets that must be ours byte for byte, and reads answers that
//! ours encodes. The interpreter is `python3`, or that of `VERGENCE_PYTHON`. Without the library (`python3 -m pip install
//! dynamixel-sdk`) the tests print `SKIPPED`; with `VERGENCE_REQUIRE_DATA=1` they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "a peer talks in real time")]

#[path = "elf_rig/build.rs"]
mod build;
mod common;
mod conversation;

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use common::python;
use common::servo_line::ServoLine;
use conversation::{Conversation, Wired};
use serde_json::{Value, json};
use vergence::sim::{SimulatedChip, simulated_chip};
use vergence_board::Served;
use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{BulkItem, Encoded, Id, ResetScope, answer, encode};
use vergence_mcu::UartId;
use vergence_plant::Plant;
use vergence_plant::servo::{Free, Servo, ServoBus, ServoModel};
use vergence_protocol::{ControllerState, Microseconds, Status};

fn run(python: &str, script: &str, arguments: &[String]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/servo_sdk").join(script);
    let output = Command::new(python).arg(script).args(arguments).output().expect("python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn near(value: &Value, expected: i64) {
    let value = value.as_i64().unwrap();
    assert!((value - expected).abs() <= 3, "{value} is not {expected}");
}

#[test]
fn the_library_drives_simulated_servos() {
    let Some(python) = python("import dynamixel_sdk.group_sync_read", "dynamixel-sdk") else { return };
    let servo = |number| Servo::new(ServoModel::XM430_W350, id(number), Baud::M1, std::f64::consts::PI);
    let line = ServoLine::serve(ServoBus::new((13..18).map(servo).collect(), Free::default()));
    let said = run(&python, "talk.py", &[line.name.clone(), "1000000".to_owned()]);
    drop(line.take_back());

    // The library's results: 0 is success, -3001 no answer.
    let there = json!([1020, 0, 0]);
    assert_eq!(said["ping"], json!([there, there, there, there, there, [0, -3001, 0]]));
    assert_eq!(said["broadcast_ping"], json!([13, 14, 15, 16, 17].map(|id| [id, 1020, 46])));
    assert_eq!(said["led"], json!([[0, 0], [1, 0, 0]]));
    assert_eq!(said["read_only"], json!([0, 7]), "access error");
    assert_eq!(said["range"], json!([0, 4]), "data range error");
    assert_eq!(said["stuffed"], json!([[0, 0], [0xFFFD_FFFF_u32, 0, 0]]));
    assert_eq!(said["registered"], json!([[0, 0], [0, 0, 0], [1, 0, 0]]), "{}", said["registered"]);
    for name in ["sync", "fast_sync"] {
        assert_eq!(said[name][0], 0, "{name}");
        (13..18).zip(said[name][1].as_array().unwrap()).for_each(|(servo, at)| near(at, 1900 + 20 * servo));
    }
    for name in ["bulk", "fast_bulk"] {
        assert_eq!(said[name][0], 0, "{name}");
        near(&said[name][1], 1900 + 20 * 13);
        assert_eq!((&said[name][2], &said[name][3]), (&json!(120), &json!(25)), "12 V and 25 degrees");
    }
    assert_eq!(said["bulk_write"], json!([[0, 0, 0], [1, 0, 0]]));
    assert_eq!((&said["reboot"], &said["rebooted"]), (&json!([0, 0]), &json!([0, 0, 0])));
    assert_eq!((&said["clear"], &said["reset"]), (&json!([0, 0]), &json!([0, 0])));
    assert_eq!(said["after_reset"], json!([800, 0, 0]), "the position loop's gain");
}

#[test]
fn the_library_sends_what_we_send_and_reads_what_we_answer() {
    let Some(python) = python("import dynamixel_sdk.group_sync_read", "dynamixel-sdk") else { return };
    let trunk = [13, 14, 15, 16, 17].map(id);
    let read = |id, address, length| BulkItem { id, address, length, data: &[] };
    let write = |id, address, data| BulkItem { id, address, length: 0, data };
    let reads = [read(13, 132, 4), read(14, 146, 1)];
    let ours: [(&str, Result<Encoded, _>); 14] = [
        ("ping", encode::ping(id(7))),
        ("read", encode::read(id(200), 132, 4)),
        ("write", encode::write(id(3), 116, &0x1234_5678_u32.to_le_bytes())),
        ("reg_write", encode::reg_write(id(9), 102, &[0x12, 0x34])),
        ("action", encode::action(Id::BROADCAST)),
        ("factory_reset", encode::factory_reset(id(5), ResetScope::ExceptIdAndBaud)),
        ("reboot", encode::reboot(id(252))),
        ("clear", encode::clear_turns(id(1))),
        ("sync_write", encode::sync_write(116, &trunk.map(|id| (id, [id.get(), 2, 3, 4])))),
        ("sync_read", encode::sync_read(126, 10, &trunk)),
        ("fast_sync_read", encode::fast_sync_read(126, 10, &trunk)),
        ("bulk_read", encode::bulk_read(&reads)),
        ("fast_bulk_read", encode::fast_bulk_read(&reads)),
        ("bulk_write", encode::bulk_write(&[write(13, 116, &[1, 2, 3, 4][..]), write(14, 65, &[1])])),
    ];
    // Answers whose data need stuffing, in all the ways that the pattern can lie.
    let data: [&[u8]; 5] = [
        &[1, 2, 3, 4],
        &[0xFF, 0xFF, 0xFD],
        &[0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD, 0x00],
        &[0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD],
        &[0xFD; 9],
    ];
    let answers: Vec<String> = data.iter().map(|data| hex(&answer::status(id(42), 0, data).unwrap())).collect();
    let said = run(&python, "packets.py", &answers);
    for (name, packet) in ours {
        assert_eq!(said["packets"][name], hex(&packet.unwrap()), "{name}");
    }
    for (data, read) in data.iter().zip(said["answers"].as_array().unwrap()) {
        // An error byte of 0 comes before the data.
        assert_eq!(read, &json!([0, 42, format!("00{}", hex(data))]));
    }
}

/// The firmware on the simulated chip, with the simulated robot.
struct Chip(SimulatedChip);

impl Wired for Chip {
    fn advance(&mut self, to: Microseconds) {
        self.0.run_until(to.0);
        self.0.settle().unwrap();
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.0.send(bytes);
    }

    fn transmit(&mut self) -> Vec<u8> {
        self.0.take_output()
    }

    fn plant(&self) -> &Plant {
        self.0.plant()
    }
}

/// All that the firmware says on the bus, from its set-up of the servos to a move: the library finds each packet sound, and
/// sends the same bytes for the same contents.
#[test]
fn the_library_understands_the_firmware() {
    let Some(python) = python("import dynamixel_sdk.group_sync_read", "dynamixel-sdk") else { return };
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/rigs/origaker.toml");
    let rig = vergence_rig::Rig::from_toml(&std::fs::read_to_string(rig).unwrap()).unwrap();
    let chip = simulated_chip(&[build::build("vergence-nucleo-g474")], &rig, 1).unwrap();
    let mut talk = Conversation::with_board(Chip(chip), Microseconds(0));
    talk.connect();
    talk.wait(500_000);
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    talk.jog([10_000, 10_000, -20_000, 0, 0]);
    talk.wait(300_000);
    let said: Vec<u8> =
        talk.board.0.machine().chip_mut().take_sent(UartId::USART3).into_iter().map(|sent| sent.byte).collect();

    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/servo_sdk/wire.py");
    let mut child =
        Command::new(&python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python starts");
    child.stdin.take().unwrap().write_all(hex(&said).as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let packets: Vec<(u8, u8, u16, u16, String, Option<String>)> =
        serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(packets.len() > 500, "{}", packets.len());
    for (id, instruction, theirs, ours, sent, again) in &packets {
        assert_eq!(theirs, ours, "CRC of instruction {instruction:#x} to {id}: {sent}");
        assert!(again.as_ref().is_none_or(|again| again == sent), "{sent} {again:?}");
    }
    let count = |wanted: u8| packets.iter().filter(|packet| packet.1 == wanted).count();
    // Ping, read, write, sync write, fast sync read.
    let counts = [0x01, 0x02, 0x03, 0x83, 0x8A].map(count);
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    let read = run(&python, "packets.py", &[])["packets"]["fast_sync_read"].clone();
    assert!(packets.iter().any(|packet| read == packet.4), "the library's own question to all joints");
}
