//! The unmodified firmware on the simulated chip: each pin does what the wiring table of `docs/firmware.md` says.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod elf_rig;

use elf_rig::{BOTH, Conversation, ElfBoard, Standing, Wired};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{Drive, Halt, Picoseconds, Pin};
use vergence_protocol::{
    AxisList, ControllerState, FaultCode, Jog, Micro, MoveId, Permille, Refusal, Request, SettingItem, SettingKey,
    Status,
};

/// With the wiring table.
const DOCUMENTATION: &str = include_str!("../docs/firmware.md");

type Talk = Conversation<ElfBoard>;

/// How a pin is used (RM0440, 9.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Input,
    Output,
    /// With this number.
    Alternate(u32),
    Analog,
}

#[test]
fn pins_are_set_as_the_wiring_table_says() {
    let mut talk = Talk::open(&Standing::default());
    let mut checked = Vec::new();
    for row in DOCUMENTATION.lines().filter(|line| line.starts_with("| ") && !line.contains("reserved")) {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        for (index, name) in cells[2].split(", ").enumerate() {
            let (Some(expected), Some(pin)) = (documented(cells[3], index), Pin::named(name)) else { continue };
            assert_eq!(configured(&mut talk, pin), expected, "{name}: {row}");
            checked.push(expected);
        }
    }
    let count = |wanted: fn(&Use) -> bool| checked.iter().filter(|one| wanted(one)).count();
    assert_eq!(count(|one| matches!(one, Use::Alternate(_))), 13, "link, steps, encoders, trigger, drivers' line, SPI");
    assert_eq!(
        count(|&one| one == Use::Output),
        7,
        "both directions, drivers off, holding current, encoders' select, LED"
    );
    assert_eq!(count(|&one| one == Use::Input), 7, "index lines, home switches, hard limits, emergency stop");
}

/// The use of pin `index` of a table row that names `peripheral`: "input", "output" or "TIM2_CH1, CH2 (AF1)". Where the
/// row gives fewer alternate functions than pins, all pins have the first.
fn documented(peripheral: &str, index: usize) -> Option<Use> {
    match peripheral {
        "input" => return Some(Use::Input),
        "output" => return Some(Use::Output),
        _ => {}
    }
    let functions: Vec<u32> =
        peripheral.split("(AF").skip(1).filter_map(|rest| rest.split(')').next()?.parse().ok()).collect();
    functions.get(index).or(functions.first()).map(|&number| Use::Alternate(number))
}

/// The use that the firmware has given to a pin (RM0440, 9.4.1 and 9.4.10).
fn configured(talk: &mut Talk, pin: Pin) -> Use {
    let name = pin.to_string();
    let port = 0x4800_0000 + 0x400 * u32::from(name.as_bytes()[1] - b'A');
    let number: u32 = name[2..].parse().expect("a number");
    let machine = &mut talk.board.machine;
    let now = machine.cpu().now();
    let mut read = |offset| machine.chip_mut().read(now, port + offset, Access::Word).expect("a register");
    match read(0) >> (2 * number) & 3 {
        0 => Use::Input,
        1 => Use::Output,
        2 => Use::Alternate(read(0x20 + 4 * (number / 8)) >> (4 * (number % 8)) & 0xF),
        _ => Use::Analog,
    }
}

/// Step and direction pins of both axes, as a person wires them.
const STEP: [&str; 2] = ["PA8", "PC6"];
const DIRECTION: [&str; 2] = ["PA9", "PC8"];
/// A whole number of steps on each axis: 1 mm at 800 steps a millimetre, a hundredth of a turn at 64 000 steps a turn.
const JOG: [i32; 2] = [1_000, 62_832];
const STEPS: [usize; 2] = [800, 640];
/// From a change of direction to the next step, in picoseconds: 5 us, as the wiring table says.
const SETUP: u64 = 5_000_000;

/// A change of a traced pin.
struct Edge {
    /// In picoseconds.
    at: u64,
    pin: usize,
    high: bool,
}

/// The levels at the beginning of a trace of `pins`, and the edges since.
fn traced(talk: &Talk, pins: usize) -> (Vec<bool>, Vec<Edge>) {
    let dump = talk.board.machine.chip().vcd(|pin| pin.to_string());
    let (_, values) = dump.split_once("#0\n$dumpvars\n").expect("a value change dump");
    let mut levels = vec![false; pins];
    let (mut at, mut edges, mut begun) = (0, Vec::new(), false);
    for line in values.lines() {
        if let Some(time) = line.strip_prefix('#') {
            at = time.parse().expect("a time");
        } else if line == "$end" {
            begun = true;
        } else {
            let (pin, high) = (usize::from(line.as_bytes()[1] - b'!'), line.starts_with('1'));
            if begun {
                edges.push(Edge { at, pin, high });
            } else {
                levels[pin] = high;
            }
        }
    }
    (levels, edges)
}

/// Swapped step and direction pins, of one axis or between the axes, would show as steps on the wrong pin, as a wrong
/// count, or as a direction that changes while steps are made.
#[test]
fn each_axis_steps_on_its_step_pin_and_turns_by_its_direction_pin() {
    let mut talk = Talk::open(&Standing::default());
    assert_eq!(talk.arm(), Status::Accepted);
    let pins: Vec<Pin> = STEP.into_iter().chain(DIRECTION).filter_map(Pin::named).collect();
    assert_eq!(pins.len(), 4);
    for (number, (axis, forward)) in (1..).zip([(0, true), (0, false), (1, true), (1, false), (0, true), (1, true)]) {
        talk.board.machine.chip_mut().trace(&pins);
        let mut by = [Micro(0); 2];
        by[axis] = Micro(if forward { JOG[axis] } else { -JOG[axis] });
        let jog = Jog { id: MoveId(number), by: AxisList::from_iter(by), speed: Permille::FULL };
        assert_eq!(talk.ask(Request::Jog(jog)), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        let (mut levels, edges) = traced(&talk, pins.len());
        let (mut steps, mut turned_at) = ([0; 2], None);
        for edge in edges {
            levels[edge.pin] = edge.high;
            match edge.pin {
                step @ 0..2 if edge.high => {
                    steps[step] += 1;
                    assert_eq!(levels[2 + axis], forward, "{} at step {steps:?}", DIRECTION[axis]);
                    assert!(turned_at.is_none_or(|turned| edge.at >= turned + SETUP), "a step too soon after a turn");
                }
                0..2 => {}
                direction => {
                    assert_eq!(direction, 2 + axis, "the other axis turned");
                    assert_eq!(steps, [0; 2], "a turn while steps are made");
                    turned_at = Some(edge.at);
                }
            }
        }
        let mut expected = [0; 2];
        expected[axis] = STEPS[axis];
        assert_eq!(steps, expected, "steps on {STEP:?}");
    }
}

/// A hard limit switch is normally closed: an open line, whether the stage opened it or a wire broke, is the limit.
#[test]
fn a_broken_limit_wire_counts_as_the_limit_reached() {
    for (axis, name) in [(0, "PC2"), (1, "PC3")] {
        let wire = Pin::named(name).expect("a pin");
        let mut talk = Talk::open(&Standing::default());
        assert_eq!(talk.arm(), Status::Accepted);
        assert_eq!(talk.home(), Status::Accepted);
        talk.wait(100_000);
        talk.board.machine.chip_mut().drive(wire, Drive::Floating);
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HardLimit, Some(axis)));
        assert!(!talk.board.plant().drivers_on());
        assert_eq!(talk.clear(), Status::Accepted);
        assert_eq!(talk.arm(), Status::Accepted);
        assert_eq!(talk.ask(Request::Home { axes: BOTH }), Status::Refused(Refusal::AtHardLimit { axis }));
        talk.board.machine.chip_mut().drive(wire, Drive::Low);
        talk.wait(20_000);
        assert_eq!(talk.ask(Request::Home { axes: BOTH }), Status::Accepted);
    }
    let text = FaultCode::HardLimit.to_string();
    assert!(text.contains("opened") && text.contains("wire is broken"), "{text}");
}

/// The filter of an encoder's lines swallows what is shorter than an eighth of the time between two counts at full speed: 0.75 us
/// at 160 kHz, and at most 6 us. It follows a change of the settings.
#[test]
fn short_pulses_on_an_encoder_s_line_are_not_counted() {
    let mut talk = Talk::open(&Standing::default());
    assert_eq!(swallowed_us(&mut talk, "PA0", 0x4000_0024), 1);
    let rotary = swallowed_us(&mut talk, "PB2", 0x4000_0C24);
    assert!((6..=7).contains(&rotary), "6 us, by whole ones: {rotary}");
    let key = SettingKey { item: SettingItem::Speed, axis: 0 };
    assert_eq!(talk.ask(Request::SetSetting { key, value: 20_000 }), Status::Accepted);
    assert_eq!(swallowed_us(&mut talk, "PA0", 0x4000_0024), 3, "a quarter of the speed");
}

/// Time after which a new level of a line is counted, in whole microseconds; the counter is at this address.
fn swallowed_us(talk: &mut Talk, line: &str, counter: u32) -> u64 {
    let line = Pin::named(line).expect("a pin");
    talk.board.machine.chip_mut().drive(line, Drive::High);
    let before = count_after(talk, 50, counter);
    talk.board.machine.chip_mut().drive(line, Drive::Low);
    (1..50).find(|_| count_after(talk, 1, counter) != before).expect("the level is counted in the end")
}

/// The register at this address after so many microseconds.
fn count_after(talk: &mut Talk, us: u64, register: u32) -> u32 {
    let machine = &mut talk.board.machine;
    let until = Picoseconds(machine.time().0 + Picoseconds::microseconds(us).0);
    assert_eq!(machine.run_until(until), Halt::Reached);
    let now = machine.cpu().now();
    machine.chip_mut().read(now, register, Access::Word).expect("a timer's counter")
}
