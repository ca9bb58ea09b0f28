//! The unmodified firmware on the simulated chip: from power-on to the modes, and through what goes wrong.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{BOTH, Board, Conversation, ElfBoard, LEASE_MS, Standing, Wired, decode, programs};
use vergence_control::{REST_US, RigIo};
use vergence_cpu::{Access, Bus};
use vergence_image::layout::HARDWARE;
use vergence_mcu::{FLASH_BASE, Halt, Picoseconds, RAM_BASE, ResetCause as Bite};
use vergence_plant::{EncoderFault, bench_settings};
use vergence_protocol::management::{ImageHeader, Management};
use vergence_protocol::{
    AxisMask, ControllerState, FaultCode, Mode, MovePhase, Refusal, Report, Request, ResetCause, SettingItem,
    SettingKey, Status, StopKind,
};

/// Baseline in micrometres, separation in microradians.
const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
const HUMAN: [i32; 2] = [145_000, 0];

type Talk = Conversation<ElfBoard>;

#[test]
fn from_power_on_to_herbivore_and_human() {
    let mut talk = Talk::open(&Standing::default());
    let info = talk.info();
    println!("{info:?} at {:?}", talk.now);
    assert_eq!((info.axes, info.reset, info.firmware), (2, ResetCause::PowerOn, [0, 1, 0]));
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Refused(Refusal::NotArmed));
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Refused(Refusal::NotReferenced { axis: 0 }));
    assert_eq!(talk.home(), Status::Accepted);
    let took = talk.wait_for(ControllerState::Ready);
    println!("homed in {took} us, loads {:?}", talk.loads());
    assert_eq!(talk.pose().referenced, BOTH);
    go(&mut talk, HERBIVORE, 1);
    go(&mut talk, HUMAN, 2);
    assert!(talk.faults.is_empty());
    assert_eq!(talk.host.statistics().poses_lost, 0);
    assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    assert!(!talk.board.plant().drivers_on());
    assert_eq!(talk.board.machine.resets(), 0);
}

#[test]
fn a_stop_in_mid_move_keeps_the_reference() {
    let mut talk = under_way();
    assert_eq!(talk.ask(Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.pose().referenced), (MovePhase::Stopped, BOTH));
    assert_rest(&mut talk);
    go(&mut talk, HUMAN, 2);
}

#[test]
fn a_host_that_dies_in_mid_move_leaves_the_stages_at_rest() {
    let mut talk = under_way();
    talk.alive = false;
    // The lease, and half a second of braking.
    talk.wait(u64::from(LEASE_MS) * 1_000 + 500_000);
    assert_rest(&mut talk);
    talk.reconnect(0x0a11_7e00);
    assert_eq!((talk.pose().state, talk.fault().code), (ControllerState::LinkLost, FaultCode::LeaseExpired));
    assert_eq!(talk.arm(), Status::Refused(Refusal::Latched));
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    go(&mut talk, HUMAN, 2);
}

#[test]
fn a_hard_limit_cuts_the_drivers() {
    let mut standing = Standing::default();
    standing.mechanics[0].hard_limits[1] = 80_000.0;
    let mut talk = Talk::homed(&standing);
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HardLimit, Some(0)));
    assert!(!talk.board.plant().drivers_on());
    // Two ticks at 80 mm/s, and what the load then still creeps.
    assert!((80_000.0..80_280.0).contains(&talk.loads()[0]), "{:?}", talk.loads());
    // A fault must not keep out the firmware that mends it.
    let header = ImageHeader { hardware: HARDWARE, version: [1, 0, 0], length: 1_000, ..ImageHeader::default() };
    talk.host.manage(Management::Begin(header)).expect("the line takes it");
    talk.wait_for(ControllerState::Updating);
    assert_eq!(talk.fault().code, FaultCode::HardLimit);
}

#[test]
fn an_encoder_that_stops_is_a_stall_and_one_that_turns_round_is_found_out() {
    for (harm, code) in [(EncoderFault::Stuck, FaultCode::Stall), (EncoderFault::Reversed, FaultCode::WrongDirection)] {
        let mut talk = under_way();
        talk.board.with_plant(|plant| plant.axis_mut(0).expect("there is one").fail_encoder(Some(harm)));
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (code, Some(0)));
        assert!(!talk.board.plant().drivers_on());
        assert_rest(&mut talk);
    }
}

#[test]
fn the_emergency_stop_is_seen_and_cleared_when_released() {
    let mut talk = under_way();
    talk.board.with_plant(|plant| plant.press_emergency_stop(true));
    talk.wait_for(ControllerState::Fault);
    assert_eq!(talk.fault().code, FaultCode::EmergencyStop);
    assert_rest(&mut talk);
    assert_eq!(talk.clear(), Status::Refused(Refusal::CausePersists));
    talk.board.with_plant(|plant| plant.press_emergency_stop(false));
    talk.wait(20_000);
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.move_to(HUMAN, 2), Status::Refused(Refusal::NotReferenced { axis: 0 }));
}

#[test]
fn saved_settings_survive_reset_and_power_loss_and_others_do_not() {
    let speed = |axis| SettingKey { item: SettingItem::Speed, axis };
    let mut talk = Talk::open(&Standing::default());
    let set = |value| Request::SetSetting { key: speed(0), value };
    assert_eq!(talk.ask(set(50_000)), Status::Accepted);
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    assert_eq!(talk.ask(set(40_000)), Status::Accepted);
    for (id, cause) in [(7, ResetCause::Pin), (8, ResetCause::PowerOn)] {
        let lost = talk.lost;
        match cause {
            ResetCause::Pin => talk.board.machine.press_reset(),
            _ => talk.board.machine.power_on(),
        }
        talk.wait_until("the restart goes unnoticed", |talk| talk.lost > lost);
        talk.reconnect(id);
        assert_eq!(talk.info().reset, cause);
        let Report::Setting { value, .. } = talk.answer(Request::GetSetting(speed(0))) else { panic!("no setting") };
        assert_eq!(value, 50_000);
    }
}

#[test]
fn the_log_says_who_starts() {
    let mut talk = Talk::open(&Standing::default());
    talk.wait(100_000);
    let said = decode(&talk.log, &programs()[0]);
    let build = talk.info().build;
    assert_eq!(said.first(), Some(&format!("info: vergence 0.1.0, build {build:016x}")), "{said:?}");
}

/// A branch with link from `at` to `to` (ARM DDI 0403E, A7.7.18, encoding T1).
fn call(at: u32, to: u32) -> [u8; 4] {
    let offset = to.wrapping_sub(at + 4);
    let bit = |number: u32| offset >> number & 1;
    let flipped = |number| (bit(number) ^ bit(24)) ^ 1;
    let first = 0xF000 | bit(24) << 10 | offset >> 12 & 0x3FF;
    let second = 0xD000 | flipped(23) << 13 | flipped(22) << 11 | offset >> 1 & 0x7FF;
    let [first, second] = [first, second].map(|half| (half as u16).to_le_bytes());
    [first[0], first[1], second[0], second[1]]
}

#[test]
fn a_panic_and_a_fault_cut_the_drivers_and_tell_where_they_came_from() {
    let program = &programs()[0];
    let [tick, panic] =
        ["TIM7_DAC", "core::panicking::panic_fmt"].map(|name| program.address_of(name).expect("a function"));
    // Undefined by definition (A7.7.193), twice.
    let undefined = [0x00, 0xDE, 0x00, 0xDE];
    for (code, said, from) in [(call(tick, panic), "panic", tick + 4 + 1), (undefined, "fault", tick)] {
        let mut talk = Talk::open(&Standing::default());
        assert_eq!(talk.arm(), Status::Accepted);
        assert!(talk.board.plant().drivers_on());
        let place = (tick - FLASH_BASE) as usize;
        let machine = &mut talk.board.machine;
        let sound = machine.chip().flash()[place..place + 4].to_vec();
        assert!(machine.chip_mut().load_flash(place, &code));
        while machine.resets() == 0 {
            assert_eq!(machine.run_for(Picoseconds::microseconds(10)), Halt::Reached);
        }
        // Before the boot loader judges the image.
        assert!(machine.chip_mut().load_flash(place, &sound));
        assert!(!talk.board.plant().drivers_on());
        talk.log.clear();
        talk.reconnect(8);
        talk.wait(100_000);
        assert_eq!(talk.info().reset, ResetCause::Software);
        let log = decode(&talk.log, program);
        println!("{log:#?}");
        let entry = log.iter().find(|entry| entry.starts_with("error: died of a ")).expect("it tells");
        assert!(entry.contains(said) && entry.contains(&format!("{from:#x}")), "{entry}");
    }
}

/// The control register of TIM7, which makes the control tick, and the interrupt enables of TIM15, which wakes tasks.
const TIM7_CR1: u32 = 0x4000_1400;
const TIM15_DIER: u32 = 0x4001_400C;

/// Somebody who no longer goes on.
#[derive(Clone, Copy, Debug)]
enum Hang {
    /// The tick's timer is stopped.
    Tick,
    /// No alarm wakes the tasks.
    Executor,
    /// The receiving task alone: its alarm is forgotten.
    Link,
}

#[test]
fn the_watchdog_bites_where_tick_executor_or_link_hang_and_the_drivers_go_off() {
    for (hang, id) in [(Hang::Tick, 8), (Hang::Executor, 9), (Hang::Link, 10)] {
        let mut talk = under_way();
        talk.alive = false;
        // What the host has sent is read.
        talk.wait(6_000);
        hang.befall(&mut talk);
        // What was under way ends.
        talk.wait(2_000);
        let before = witnesses(&mut talk);
        talk.wait(200_000);
        let after = witnesses(&mut talk);
        let lives = [0, 1].map(|witness| after[witness] != before[witness]);
        let expected = match hang {
            Hang::Tick => [false, true],
            Hang::Executor => [true, false],
            Hang::Link => [true, false],
        };
        assert_eq!(lives, expected, "{hang:?}: tick and link");
        // Half a second of patience in all.
        talk.wait(400_000);
        let machine = &talk.board.machine;
        assert_eq!((machine.resets(), machine.last_reset()), (1, Bite::Watchdog), "{hang:?}");
        assert!(!talk.board.plant().drivers_on());
        talk.reconnect(id);
        assert_eq!(talk.info().reset, ResetCause::Watchdog);
        assert_eq!((talk.pose().state, talk.pose().referenced), (ControllerState::Idle, AxisMask(0)));
        assert_rest(&mut talk);
    }
}

impl Hang {
    fn befall(self, talk: &mut Talk) {
        let now = talk.now.0;
        let machine = &mut talk.board.machine;
        let cycle = machine.cpu().now();
        let mut stop = |register| machine.chip_mut().write(cycle, register, Access::Word, 0).expect("it is there");
        match self {
            Self::Tick => stop(TIM7_CR1),
            Self::Executor => stop(TIM15_DIER),
            Self::Link => {
                let task = variable(talk, "link::receive::POOL");
                // The application's clock began within the first half second.
                let alarms = now - 500_000..now + 40_000;
                let words = talk.board.machine.chip_mut().ram_mut()[task..task + 512].chunks_exact_mut(8);
                let forgotten = words
                    .filter(|word| alarms.contains(&u64::from_le_bytes((**word).try_into().expect("eight bytes"))))
                    .map(|word| word.copy_from_slice(&u64::MAX.to_le_bytes()));
                assert!(forgotten.count() > 0, "the task waits for an alarm");
            }
        }
    }
}

/// What the watchdog's task looks at: ticks, and rounds of the link.
fn witnesses(talk: &mut Talk) -> [u32; 2] {
    ["control::TICKS", "link::ROUNDS"].map(|name| {
        let at = variable(talk, name);
        u32::from_le_bytes(talk.board.machine.chip().ram()[at..at + 4].try_into().expect("four bytes"))
    })
}

/// Where in RAM a variable of the firmware is.
fn variable(talk: &Talk, name: &str) -> usize {
    let address = talk.board.machine.firmware().address_of(&format!("vergence_nucleo_g474::{name}"));
    (address.expect("the ELF has its symbols") - RAM_BASE) as usize
}

#[test]
fn a_board_at_rest_ticks_seldom_and_goes_at_a_word() {
    let mut talk = Talk::open(&Standing::default());
    assert_eq!(talk.ask(Request::SetStream { period_us: 0 }), Status::Accepted);
    for part in 0..20 {
        talk.alive = false;
        talk.wait(100_000);
        let before = witnesses(&mut talk);
        // All over the tick of a board at rest.
        talk.now.0 += 1_000_000 + part * (REST_US + 50) / 20;
        talk.board.advance(talk.now);
        let [ticks, rounds] = [0, 1].map(|witness| witnesses(&mut talk)[witness] - before[witness]);
        assert!((45..60).contains(&ticks) && (20..50).contains(&rounds), "{ticks} ticks, {rounds} rounds of the link");
        // All in one breath: nothing that was left out was missed.
        let session = talk.host.id();
        talk.host.submit(talk.now, Request::Arm { session }).expect("there is room");
        talk.host.submit(talk.now, Request::Home { axes: BOTH }).expect("there is room");
        talk.alive = true;
        let steps = talk.board.plant().steps(0);
        talk.wait(60_000);
        assert!(talk.faults.is_empty(), "{:?}", talk.faults);
        assert!(talk.board.plant().drivers_on() && talk.board.plant().steps(0) != steps, "it searches");
        assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
        talk.wait(200_000);
        assert!(!talk.board.plant().drivers_on());
    }
}

/// In the middle of a move to the herbivore's pose.
fn under_way() -> Talk {
    let mut talk = Talk::homed(&Standing::default());
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

/// Settles at `targets`, by its own word and in truth.
fn go(talk: &mut Talk, targets: [i32; 2], mode: u8) {
    assert_eq!(talk.move_to(targets, mode), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.pose().mode), (MovePhase::Settled, Mode(mode)));
    // Tolerance, one tick of the approach to the home switch, one count.
    for (axis, (load, target)) in bench_settings().iter().zip(talk.loads().into_iter().zip(targets)) {
        let allowed = f64::from(axis.tolerance.0) + f64::from(axis.homing.approach_speed) * 1e-3 + 63.0;
        assert!((load - f64::from(target)).abs() < allowed, "{load} for {target}");
    }
}

/// Nothing moves for 300 ms.
fn assert_rest(talk: &mut Talk) {
    talk.wait(20_000);
    let (loads, pulses) = (talk.loads(), talk.board.machine.chip().world().pulses().to_vec());
    talk.wait(300_000);
    assert_eq!(talk.board.machine.chip().world().pulses(), pulses);
    for (now, before) in talk.loads().into_iter().zip(loads) {
        assert!((now - before).abs() < 1.0, "{before} to {now}");
    }
}
