//! How long the firmware takes, by the clock of the simulated chip: the control tick, and the way from a limit switch to the
//! last step. Figures of a model, see hil-sim/FIDELITY.md for what it counts.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{BOTH, Conversation, ElfBoard, POSE_PERIOD_US, Wired, at_full_speed, cruise, geared};
use vergence_mcu::{Bench, BenchWiring, Drive, Machine, Picoseconds};
use vergence_protocol::{
    ControllerState, Jog, Micro, MoveId, MovePhase, Permille, Request, SettingItem, SettingKey, Status, StopKind,
    Trigger,
};

const CORE_HZ: u64 = 170_000_000;
/// A tick in core cycles.
const TICK: u64 = CORE_HZ / 1_000;
/// The interrupt of TIM7, line 55, which runs the node.
const TICK_EXCEPTION: u16 = 16 + 55;
const STEP_HZ: u64 = 100_000;
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

/// What is asked while both axes make 100 000 steps a second, and poses come at 1 kHz.
fn questions() -> Vec<(&'static str, Request)> {
    let key = SettingKey { item: SettingItem::Backlash, axis: 0 };
    vec![
        ("poses", Request::SetStream { period_us: POSE_PERIOD_US }),
        ("trigger", Request::SetTrigger(Trigger::Every { period_us: 2_000 })),
        ("one axis", Request::GetAxis { axis: 1 }),
        ("identity", Request::GetInfo),
        ("statistics", Request::GetStatistics),
        ("log of events", Request::GetEvents { first: 0 }),
        ("a setting", Request::GetSetting(key)),
        ("a setting, refused", Request::SetSetting { key, value: 100 }),
        ("settings to save, refused", Request::SaveSettings),
        ("a search, refused", Request::Home { axes: BOTH }),
        ("a fault to clear, refused", Request::ClearFault { seen: 1 }),
    ]
}

/// Prints the longest run of the node since the last call, with what preempted it, and returns it in cycles.
fn worst(talk: &mut Conversation<ElfBoard>, what: &str) -> u64 {
    let longest = talk.board.machine.cpu().handler_time(TICK_EXCEPTION).longest_span;
    println!("{:>4} us: {what}", longest * 1_000_000 / CORE_HZ);
    talk.board.machine.time_handlers();
    longest
}

/// Places within a tick at which a request arrives.
const ARRIVALS: u64 = 8;

/// Lets the host speak at another place of the board's ticks.
fn arrive_elsewhere(talk: &mut Conversation<ElfBoard>) {
    talk.wait(2_000);
    talk.now.0 += 1_000 / ARRIVALS;
    talk.board.advance(talk.now);
}

/// The longest one, a new target at full speed, takes half of it, some microseconds more or less: paths of source files in messages move
/// the code in the flash, whose lines the model of the chip fetches.
#[test]
fn no_request_makes_a_tick_longer_than_six_tenths_of_its_period() {
    let mut talk = geared();
    talk.board.machine.time_handlers();
    let mut all = Vec::new();
    let key = SettingKey { item: SettingItem::Backlash, axis: 0 };
    assert_eq!(talk.ask(Request::SetSetting { key, value: 200 }), Status::Accepted);
    talk.wait(20_000);
    all.push(worst(&mut talk, "a setting, disarmed"));
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait(20_000);
    all.push(worst(&mut talk, "to arm"));
    assert_eq!(talk.home(), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    all.push(worst(&mut talk, "homing of both axes"));
    let by = [20_000, 300_000].into_iter().map(Micro).collect();
    assert_eq!(talk.ask(Request::Jog(Jog { id: MoveId(99), by, speed: Permille::FULL })), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    all.push(worst(&mut talk, "a jog"));
    cruise(&mut talk);
    all.push(worst(&mut talk, "a move, up to full speed"));
    for (what, question) in questions() {
        for _ in 0..ARRIVALS {
            talk.answer(question.clone());
            arrive_elsewhere(&mut talk);
        }
        all.push(worst(&mut talk, what));
        if talk.pose().phase != MovePhase::Running {
            cruise(&mut talk);
            worst(&mut talk, "a move, up to full speed");
        }
    }
    cruise(&mut talk);
    let [baseline, separation] = talk.loads();
    for (what, by) in [("one way", [10_000.0, 100_000.0]), ("the other way", [-10_000.0, -100_000.0])] {
        let targets = [baseline + by[0], separation + by[1]].map(|target| target as i32);
        for _ in 0..ARRIVALS {
            assert_eq!(talk.move_to(targets, 1), Status::Accepted);
            arrive_elsewhere(&mut talk);
        }
        talk.wait(30_000);
        all.push(worst(&mut talk, &format!("a new target, {what}")));
    }
    assert_eq!(talk.pose().state, ControllerState::Moving);
    assert_eq!(talk.ask(Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    all.push(worst(&mut talk, "a stop, down to rest"));
    cruise(&mut talk);
    assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    all.push(worst(&mut talk, "disarmed in mid-move"));
    assert!(talk.faults.is_empty(), "{:?}", talk.faults);
    assert!(all.iter().all(|&cycles| cycles < TICK * 6 / 10), "{all:?}");
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
fn a_limit_switch_stops_the_steps_within_two_ticks_and_the_time_of_one() {
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
    // Two ticks sample the switch: a whole one may pass first, and the second must run that far.
    assert!(spread(&steps).1 < 2_500 && spread(&drivers).1 < 2_500);
}
