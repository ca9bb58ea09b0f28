//! What planning costs the firmware, by the clock of the simulated chip, with one, two and three axes; what that makes for eight;
//! and eight axes that get new targets in mid-move, on the native board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use std::ops::Range;

use elf_rig::{Conversation, DEVELOPMENT_SECRET, ElfBoard, Wired, build_wired, programs, sealed_by};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_control::{AxisSettings, RigIo, plan_ticks};
use vergence_image::layout::{ACTIVE, FLASH_BASE, IMAGE};
use vergence_mcu::{Bench, BenchWiring, ChipConfig, Firmware, Machine};
use vergence_plant::{NativeBoard, Plant, Stage};
use vergence_protocol::{
    AxisMask, ControllerState, Micro, Microseconds, Mode, Move, MoveId, MovePhase, Permille, Request, Status,
};

const CYCLES_PER_US: f64 = 170.0;
/// Share of the processor that is left to the planner beside two axes at 100 kHz and poses at 1 kHz: `hil_timing` finds the
/// processor busy for less than half.
const LEFT: f64 = 0.5;

/// Bytes of the stack that must stay unused, for interrupts in the deepest call.
const SPARE_STACK: u32 = 8 * 1024;

/// A linear stage, then pinions: as the firmware is wired.
fn stages(axes: usize) -> Vec<Stage> {
    let linear = Stage::linear(Micro(60_000), Micro(220_000), 2_000_000);
    let rotary = Stage::rotary(Micro(0), Micro(2_268_928), 100_000);
    (0..axes).map(|axis| if axis == 0 { linear } else { rotary }).collect()
}

/// Firmware for so many axes behind the boot loader, on a chip that is wired so.
fn chip(axes: usize) -> Conversation<ElfBoard> {
    let [usual, boot_loader] = programs();
    let application = match axes {
        1 => read(&build_wired("one-axis")),
        2 => usual.clone(),
        _ => read(&build_wired("three-axes")),
    };
    let mechanics: Vec<_> = stages(axes).iter().map(|stage| stage.mechanics).collect();
    let plant = Plant::new(&mechanics, &[63_000.0, 40_000.0, 40_000.0][..axes]);
    let wiring = BenchWiring::nucleo_g474_of(axes).expect("a wiring");
    let mut machine = Machine::new(ChipConfig::default(), Bench::new(wiring, plant));
    let seal = sealed_by(&DEVELOPMENT_SECRET, &application.flat(FLASH_BASE + IMAGE.start)).to_bytes();
    machine.load(boot_loader.clone()).expect("it fits");
    assert!(machine.chip_mut().load_flash(ACTIVE.start as usize, &seal));
    machine.load(application).expect("it fits");
    machine.power_on();
    let mut board = ElfBoard { machine, baud: 921_600, heard_baud: 921_600 };
    board.paint_stack();
    let mut talk = Conversation::with_board(board, Microseconds(0));
    talk.connect();
    homed(&mut talk, axes);
    talk
}

fn read(elf: &std::path::Path) -> Firmware {
    Firmware::from_elf(&std::fs::read(elf).expect("it was built")).expect("it is for this chip")
}

fn homed<B: Wired>(talk: &mut Conversation<B>, axes: usize) {
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.ask(Request::Home { axes: AxisMask::first(axes) }), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
}

fn move_to<B: Wired>(talk: &mut Conversation<B>, number: u16, targets: impl IntoIterator<Item = i32>) {
    let targets = targets.into_iter().map(Micro).collect();
    let order = Move { id: MoveId(number), mode: Mode(1), targets, speed: Permille::FULL };
    assert_eq!(talk.ask(Request::MoveTo(order)), Status::Accepted, "{:?}", talk.faults);
}

/// Cycles that the executor's tasks take in 40 ms, from `ask` on.
fn tasks(talk: &mut Conversation<ElfBoard>, ask: impl FnOnce(&mut Conversation<ElfBoard>)) -> u64 {
    let machine = &mut talk.board.machine;
    machine.time_handlers();
    let (begun, asleep) = (machine.cpu().now(), machine.cpu().asleep());
    let until = talk.now.0 + 40_000;
    ask(talk);
    talk.wait(until - talk.now.0);
    let cpu = talk.board.machine.cpu();
    let handlers: u64 = (0..256).map(|exception| cpu.handler_time(exception).total).sum();
    cpu.now() - begun - (cpu.asleep() - asleep) - handlers
}

/// Cycles that the plan of a move takes: from rest, and the largest of new targets in mid-move. Another question has the same
/// way through the link, and no plan.
fn costs(axes: usize) -> [u64; 2] {
    let mut talk = chip(axes);
    let question = tasks(&mut talk, |talk| drop(talk.answer(Request::GetAxis { axis: 0 })));
    let [near, far] =
        [[100_000, 300_000, 400_000], [200_000, 1_500_000, 1_400_000]].map(|targets| targets[..axes].to_vec());
    let from_rest = tasks(&mut talk, |talk| move_to(talk, 1, far.clone()));
    let mut turning = 0;
    for number in 2..12 {
        talk.wait(u64::from(number) * 17_000);
        let target = if number % 2 == 0 { &near } else { &far };
        turning = turning.max(tasks(&mut talk, |talk| move_to(talk, number, target.clone())));
        assert!(talk.faults.is_empty(), "{:?}", talk.faults);
    }
    let spare = talk.board.stack_spare();
    println!("{axes} axes: {spare} bytes of the stack were never used");
    assert!(spare >= SPARE_STACK, "{axes} axes");
    [from_rest, turning].map(|cycles| cycles.saturating_sub(question))
}

#[test]
fn the_time_for_a_plan_suffices_for_any_number_of_axes() {
    let all: Vec<[u64; 2]> = (1..=3).map(costs).collect();
    for (axes, [rest, turning]) in (1..).zip(&all) {
        println!("{axes} axes: {rest} cycles from rest, {turning} at most for a new target in mid-move");
    }
    let most_of_one = (1..).zip(&all).map(|(axes, costs)| costs[1] / axes).max().expect("three costs");
    for axes in [2, 3, 8] {
        let us = most_of_one as f64 * axes as f64 / CYCLES_PER_US / LEFT;
        let given = plan_ticks(axes) * 1_000;
        println!("{axes} axes: {us:.0} us of the {given} us that a plan has");
        assert!(us < f64::from(given), "{axes} axes");
    }
}

const EIGHT: usize = 8;
/// Largest change of an axis' steps from one tick to the next: the largest acceleration makes a third of a step, and whole steps
/// round two.
const JUMP: i32 = 3;

#[test]
fn eight_axes_take_new_targets_in_mid_move() {
    let stages = stages(EIGHT);
    let settings: Vec<AxisSettings> = stages.iter().map(|stage| stage.settings).collect();
    let mechanics: Vec<_> = stages.iter().map(|stage| stage.mechanics).collect();
    // Near home, because they home one after the other.
    let at: Vec<f64> = settings.iter().map(|axis| f64::from(axis.min.0) + 3_000.0).collect();
    let board = NativeBoard::standing_at(&settings, &mechanics, &at, 8).expect("settings of the bench");
    let mut talk = Conversation::with_board(board, Microseconds(0));
    talk.connect();
    homed(&mut talk, EIGHT);
    let mut random = Pcg64Mcg::seed_from_u64(8);
    let mut running = 0;
    for number in 1..=200 {
        running += i32::from(talk.pose().phase == MovePhase::Running);
        let targets = settings.iter().map(|axis| random.random_range(axis.min.0..=axis.max.0));
        move_to(&mut talk, number, targets.collect::<Vec<_>>());
        let ticks = random.random_range(5..600);
        smooth(&mut talk, 0..ticks);
    }
    talk.wait_for(ControllerState::Ready);
    talk.wait(50_000);
    assert_eq!(talk.pose().phase, MovePhase::Settled);
    assert!(running > 100 && talk.faults.is_empty(), "{running} in mid-move, {:?}", talk.faults);
    println!("200 new targets for eight axes, {running} in mid-move, none of which made a jump of speed");
}

/// Lets these ticks pass and compares the steps of each with those of the tick before.
fn smooth(talk: &mut Conversation<NativeBoard>, ticks: Range<u32>) {
    let steps = |talk: &Conversation<NativeBoard>| [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| talk.board.plant().steps(axis));
    let mut last = [steps(talk); 2];
    for tick in ticks {
        talk.wait(1_000);
        let now = steps(talk);
        for axis in 0..EIGHT {
            let jump = (now[axis] - last[1][axis]) - (last[1][axis] - last[0][axis]);
            // Nothing is known of the two ticks before the first.
            assert!(tick < 2 || jump.abs() <= JUMP, "axis {axis}: {jump} steps");
        }
        last = [last[1], now];
    }
}
