//! How long the firmware takes, by the clock of the simulated chip: the control tick, and the way from a limit switch to the
//! last step. Figures of a model, see hil-sim/FIDELITY.md for what it counts.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Conversation, ElfBoard, Standing};
use vergence_control::Scale;
use vergence_mcu::{Bench, BenchWiring, Drive, Machine, Picoseconds};
use vergence_protocol::{AxisKind, ControllerState, Request, SettingItem, SettingKey, Status};

const CORE_HZ: u64 = 170_000_000;
/// A tick in core cycles.
const TICK: u64 = CORE_HZ / 1_000;
/// The interrupt of TIM7, line 55, which runs the node.
const TICK_EXCEPTION: u16 = 16 + 55;
/// Steps for each metre and each turn: 100 kHz, the most that settings may ask for, at the 80 mm/s and 60 degrees/s of the
/// bench.
const STEPS_PER_UNIT: [u32; 2] = [1_250_000, 599_999];
const STEP_HZ: u64 = 100_000;
const POSE_PERIOD_US: u32 = 1_000;
/// What both axes do in the same time, each at its full speed on the way: 60 degrees take their second and longer ramps.
const FAR: [f64; 2] = [84_000.0, 1_047_198.0];

/// Both axes in the middle of a move, at 100 kHz each, with poses at 1 kHz.
fn at_full_speed() -> Conversation<ElfBoard> {
    let mut standing = Standing::default();
    for ((mechanics, kind), per_unit) in
        standing.mechanics.iter_mut().zip([AxisKind::Linear, AxisKind::Rotary]).zip(STEPS_PER_UNIT)
    {
        mechanics.motor = Scale { kind, per_unit };
    }
    let mut talk = Conversation::open(&standing);
    for (axis, steps) in (0..).zip(STEPS_PER_UNIT) {
        let key = SettingKey { item: SettingItem::StepsPerUnit, axis };
        assert_eq!(talk.ask(Request::SetSetting { key, value: steps.into() }), Status::Accepted);
    }
    assert_eq!(talk.ask(Request::SetStream { period_us: POSE_PERIOD_US }), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.home(), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    let [baseline, separation] = talk.loads();
    let targets = [baseline + FAR[0], separation + FAR[1]].map(|target| target as i32);
    assert_eq!(talk.move_to(targets, 1), Status::Accepted);
    talk.wait(400_000);
    talk
}

fn pulses(machine: &Machine<Bench>) -> [u64; 2] {
    machine.chip().world().pulses().try_into().expect("two axes")
}

#[test]
fn the_tick_leaves_most_of_the_processor_free_at_100_khz_on_both_axes() {
    let mut talk = at_full_speed();
    let machine = &mut talk.board.machine;
    let (begun, asleep, made) = (machine.cpu().now(), machine.cpu().asleep(), pulses(machine));
    machine.time_handlers();
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    let cpu = talk.board.machine.cpu();
    let elapsed = cpu.now() - begun;
    let rates = [0, 1].map(|axis| (pulses(&talk.board.machine)[axis] - made[axis]) * CORE_HZ / elapsed);
    let tick = cpu.handler_time(TICK_EXCEPTION);
    let share = |cycles: u64| 100.0 * cycles as f64 / elapsed as f64;
    let busy = share(elapsed - (cpu.asleep() - asleep));
    println!("steps {rates:?} Hz, poses at 1 kHz, {} runs of the node in {} ms", tick.runs, elapsed * 1_000 / CORE_HZ);
    println!(
        "worst run {} cycles = {} us, with what preempts it {} cycles = {} us",
        tick.longest,
        tick.longest * 1_000_000 / CORE_HZ,
        tick.longest_span,
        tick.longest_span * 1_000_000 / CORE_HZ
    );
    println!("the node takes {:.1} % of the processor, everything {busy:.1} %", share(tick.total));
    assert!(rates.iter().all(|&rate| rate.abs_diff(STEP_HZ) < STEP_HZ / 100), "{rates:?}");
    assert!(tick.runs >= 400 && tick.longest_span < TICK, "{tick:?}");
    assert!(talk.faults.is_empty(), "{:?}", talk.faults);
}

/// Places within a tick at which the switch opens.
const PHASES: u64 = 50;
/// How long to watch after that.
const WATCHED_US: u64 = 3_000;

/// Microseconds from the edge of axis 0's limit switch to the last step of any axis, and to the drivers' enable going off.
fn stopping(mut machine: Machine<Bench>) -> (u64, u64) {
    let wiring = BenchWiring::nucleo_g474();
    let edge = machine.time();
    machine.chip_mut().drive(wiring.axes[0].hard_limit.pin, Drive::High);
    let (mut made, mut last, mut off) = (pulses(&machine), 0, None);
    for us in 1..=WATCHED_US {
        machine.run_until(edge + Picoseconds::microseconds(us));
        let now = pulses(&machine);
        if now != made {
            (made, last) = (now, us);
        }
        if machine.chip().is_high(wiring.drivers_off) {
            off.get_or_insert(us);
        }
    }
    (last, off.expect("the drivers go off"))
}

#[test]
fn a_limit_switch_stops_the_steps_within_a_tick_and_the_time_of_one() {
    let talk = at_full_speed();
    let mut machine = talk.board.machine;
    let mut times = Vec::new();
    for _ in 0..PHASES {
        machine.run_for(Picoseconds::microseconds(1_000 / PHASES));
        times.push(stopping(machine.clone()));
    }
    let (steps, drivers): (Vec<_>, Vec<_>) = times.into_iter().unzip();
    let spread = |times: &[u64]| (times.iter().min().copied().unwrap_or(0), times.iter().max().copied().unwrap_or(0));
    println!("from the limit switch to the last step, at {PHASES} places of a tick: {:?} us", spread(&steps));
    println!("and to the drivers' enable: {:?} us", spread(&drivers));
    // The tick samples the switch: a whole one may pass first, and then it must run that far.
    assert!(spread(&steps).1 < 1_500 && spread(&drivers).1 < 1_500);
}
