//! What keeps stages and motors whole, in the unmodified firmware on the simulated chip: the filter of the hard limits, the
//! way off them, the holding current.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{BOTH, Conversation, ElfBoard, Standing, Wired};
use vergence_mcu::{BenchWiring, Drive, Picoseconds};
use vergence_protocol::{ControllerState, FaultCode, Refusal, Request, SettingItem, SettingKey, Status};

/// Baseline in micrometres, separation in microradians.
const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
const HUMAN: [i32; 2] = [145_000, 0];

type Talk = Conversation<ElfBoard>;

fn under_way() -> Talk {
    let mut talk = Talk::homed(&Standing::default());
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

#[test]
fn one_wrong_reading_of_a_hard_limit_stops_nothing() {
    let wire = BenchWiring::nucleo_g474().axes[0].hard_limit.pin;
    let mut talk = under_way();
    for phase in 0..20 {
        // A spike of 900 us meets the reading of one tick at most.
        talk.wait(5_000);
        let machine = &mut talk.board.machine;
        machine.run_for(Picoseconds::microseconds(50 * phase));
        machine.chip_mut().drive(wire, Drive::High);
        machine.run_for(Picoseconds::microseconds(900));
        machine.chip_mut().drive(wire, Drive::Low);
    }
    talk.wait(10_000);
    assert!(talk.faults.is_empty() && talk.pose().state == ControllerState::Moving, "{:?}", talk.faults);
    talk.board.machine.chip_mut().drive(wire, Drive::High);
    talk.wait(5_000);
    assert!(!talk.board.plant().drivers_on());
}

#[test]
fn a_slow_jog_leads_off_a_hard_limit_and_homing_goes_on() {
    let mut standing = Standing::default();
    standing.mechanics[0].hard_limits[1] = 80_000.0;
    let mut talk = Talk::homed(&standing);
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Fault);
    let met = talk.loads()[0];
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    let at_limit = Status::Refused(Refusal::AtHardLimit { axis: 0 });
    assert_eq!(talk.home(), at_limit);
    assert_eq!(talk.move_to(HUMAN, 2), at_limit);
    for deeper_or_too_far in [100, 2_000, -20_000] {
        assert_eq!(talk.jog([deeper_or_too_far, 0]), at_limit, "{deeper_or_too_far} um");
    }
    talk.watched_steps = Some(Vec::new());
    assert_eq!(talk.jog([-2_000, 0]), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    println!("met at {met:.0} um, off it at {:.0} um", talk.loads()[0]);
    assert!((talk.loads()[0] - met + 2_000.0).abs() < 100.0, "{:?}", talk.loads());
    // 40 mm/s of the search for the home switch, at 800 steps a millimetre: a step each 31 us.
    let steps = talk.watched_steps.take().expect("watched");
    let fastest = steps.windows(11).map(|some| some[10].0.0 - some[0].0.0).min().expect("it stepped");
    assert!(fastest >= 900, "{fastest} us for a millisecond's steps");
    assert_eq!(talk.home(), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!(talk.pose().referenced, BOTH);
    // Once off it, the limit counts again.
    assert_eq!(talk.move_to(HERBIVORE, 3), Status::Accepted);
    talk.wait_for(ControllerState::Fault);
    assert_eq!(talk.fault().code, FaultCode::HardLimit);
}

#[test]
fn motors_at_rest_get_their_holding_current_and_the_full_one_before_the_next_step() {
    let mut talk = Talk::homed(&Standing::default());
    assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    let key = SettingKey { item: SettingItem::HoldAfter, axis: 0 };
    let refused = talk.ask(Request::SetSetting { key, value: 1_000 });
    assert_eq!(refused, Status::Refused(Refusal::BadSetting));
    assert_eq!(talk.ask(Request::SetSetting { key, value: 300_000 }), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait(200_000);
    assert!(!talk.board.plant().is_holding());
    talk.wait(200_000);
    assert!(talk.board.plant().is_holding());
    let before = talk.steps();
    assert_eq!(talk.jog([1_000, 0]), Status::Accepted);
    assert_full_current_at_first_step(&mut talk, before);
    talk.wait_for(ControllerState::Ready);
    talk.wait(400_000);
    assert!(talk.board.plant().is_holding());
    let before = talk.steps();
    assert_eq!(talk.home(), Status::Accepted);
    assert_full_current_at_first_step(&mut talk, before);
    talk.wait_for(ControllerState::Ready);
    talk.wait(400_000);
    assert!(talk.board.plant().is_holding());
    assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    assert!(!talk.board.plant().is_holding());
    // Never, where the setting is zero.
    assert_eq!(talk.ask(Request::SetSetting { key, value: 0 }), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait(1_000_000);
    assert!(!talk.board.plant().is_holding());
}

fn assert_full_current_at_first_step(talk: &mut Talk, before: [i32; 2]) {
    while talk.steps() == before {
        talk.board.machine.run_for(Picoseconds::microseconds(50));
    }
    assert!(!talk.board.plant().is_holding());
}
