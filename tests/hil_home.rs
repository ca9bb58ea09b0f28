//! Homing as labs wire it: the switch at either end of the range, normally open or normally closed, and hard limits of either
//! contact; on the native board and on the unmodified firmware, whose pins read the lines.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing, stories};
use vergence_control::HomeEnd;
use vergence_plant::{AxisMechanics, NativeBoard, bench_settings};
use vergence_protocol::{
    AxisMask, ControllerState, FaultCode, MovePhase, Refusal, Request, SettingItem, SettingKey, Status, StopKind,
};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
/// How far beyond the range the switches are, in micrometres and microradians.
const BEYOND: [f64; 2] = [2_000.0, 26_180.0];
const NORMALLY_CLOSED: i64 = 1;
const HIGH: i64 = 1;

fn set<B: Board>(talk: &mut Conversation<B>, axis: u8, item: SettingItem, value: i64) -> Status {
    talk.ask(Request::SetSetting { key: SettingKey { item, axis }, value })
}

fn sets<B: Board>(talk: &mut Conversation<B>, axis: u8, settings: &[(SettingItem, i64)]) {
    for &(item, value) in settings {
        assert_eq!(set(talk, axis, item, value), Status::Accepted, "{} = {value}", item.name());
    }
}

/// Stages in the middle, whose home switches are like this.
fn standing(end: HomeEnd, normally_closed: bool) -> Standing {
    let mut standing = Standing { at: [180_000.0, 1_900_000.0], ..Standing::default() };
    for (axis, mechanics) in standing.mechanics.iter_mut().enumerate() {
        mechanics.switches.home_end = end;
        mechanics.switches.home_normally_closed = normally_closed;
        if end == HomeEnd::High {
            mechanics.home_switch = f64::from(bench_settings()[axis].max.0) + BEYOND[axis];
        }
    }
    standing
}

/// The board knows of them.
fn told<B: Board>(end: HomeEnd, normally_closed: bool) -> Conversation<B> {
    let standing = standing(end, normally_closed);
    let mut talk = Conversation::<B>::open(&standing);
    for (axis, mechanics) in (0..).zip(&standing.mechanics) {
        if normally_closed {
            sets(&mut talk, axis, &[(SettingItem::HomeSwitch, NORMALLY_CLOSED)]);
        }
        if end == HomeEnd::High {
            let at = mechanics.home_switch.round() as i64;
            sets(&mut talk, axis, &[(SettingItem::HomeSwitchAt, at), (SettingItem::HomeEnd, HIGH)]);
        }
    }
    talk
}

/// Homing ends at the nearest end of the range, with a reference as good as the slow approach: a tick of it, and the play.
fn homes_and_moves<B: Board>(talk: &mut Conversation<B>, end: HomeEnd) {
    talk.arm_and_home();
    for (axis, settings) in bench_settings().iter().enumerate() {
        let wanted = f64::from(if end == HomeEnd::Low { settings.min.0 } else { settings.max.0 });
        let allowed = f64::from(settings.tolerance.0) + f64::from(settings.homing.approach_speed) * 1e-3 + 120.0;
        let off = talk.loads()[axis] - wanted;
        assert!(off.abs() <= allowed, "axis {axis} is {off} off");
    }
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.faults.len()), (MovePhase::Settled, 0), "{:?}", talk.faults);
    assert!((talk.loads()[0] - f64::from(HERBIVORE[0])).abs() < 30.0);
}

fn homes_at_the_high_end<B: Board>() {
    homes_and_moves(&mut told::<B>(HomeEnd::High, false), HomeEnd::High);
}

fn homes_by_a_normally_closed_switch<B: Board>() {
    homes_and_moves(&mut told::<B>(HomeEnd::Low, true), HomeEnd::Low);
}

fn homes_at_the_high_end_by_a_normally_closed_switch<B: Board>() {
    homes_and_moves(&mut told::<B>(HomeEnd::High, true), HomeEnd::High);
}

/// A wire of a normally closed switch that breaks looks operated, and nothing runs away.
fn a_broken_wire_of_a_normally_closed_switch_is_noticed<B: Board>() {
    let mut talk = told::<B>(HomeEnd::Low, true);
    talk.board.with_plant(|plant| plant.axis_mut(0).expect("an axis").fix_home_switch(Some(true)));
    assert_eq!((talk.arm(), talk.home()), (Status::Accepted, Status::Accepted));
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HomeSwitchStuck, Some(0)));
    assert!((talk.loads()[0] - 180_000.0).abs() < 12_000.0, "backed off once: {:?}", talk.loads());
}

/// Settings are changed one at a time; in between nothing homes.
fn an_end_where_no_switch_is_refuses_to_home<B: Board>() {
    let mut talk = Conversation::<B>::open(&standing(HomeEnd::High, false));
    sets(&mut talk, 1, &[(SettingItem::HomeEnd, HIGH)]);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.home(), Status::Refused(Refusal::HomeSwitchAside { axis: 1 }));
    // The switch between positions of moves, and values that are no choice.
    assert_eq!(talk.ask(Request::Stop { kind: StopKind::TorqueOff }), Status::Accepted);
    let bad = [
        (SettingItem::HomeSwitchAt, 1_000_000),
        (SettingItem::HomeEnd, 2),
        (SettingItem::HomeSwitch, 3),
        (SettingItem::HardLimit, -1),
        // Plain drivers have no StallGuard.
        (SettingItem::HomeSwitch, 2),
        (SettingItem::StallWatch, 1),
        (SettingItem::StallThreshold, 256),
    ];
    for (item, value) in bad {
        assert_eq!(set(&mut talk, 1, item, value), Status::Refused(Refusal::BadSetting), "{} = {value}", item.name());
    }
}

/// Another end or another switch is another zero.
fn a_reference_ends_with_the_switch_that_gave_it<B: Board>() {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    assert_eq!(talk.ask(Request::Disarm), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    assert_eq!(talk.pose().referenced, AxisMask::first(2));
    sets(&mut talk, 0, &[(SettingItem::HardLimit, 1), (SettingItem::HardLimit, 0), (SettingItem::StallThreshold, 9)]);
    talk.wait(20_000);
    assert_eq!(talk.pose().referenced, AxisMask::first(2), "what moves no zero keeps it");
    sets(&mut talk, 0, &[(SettingItem::HomeSwitch, NORMALLY_CLOSED)]);
    talk.wait(20_000);
    assert_eq!(talk.pose().referenced, AxisMask(2));
    sets(&mut talk, 1, &[(SettingItem::HomeEnd, HIGH)]);
    talk.wait(20_000);
    assert_eq!(talk.pose().referenced, AxisMask(0));
}

/// Hard limits that close beyond the range stop as those that open; with the wrong contact nothing can be armed for long.
fn normally_open_limits_stop_too<B: Board>() {
    let mut standing = Standing::default();
    let open = |mechanics: &mut AxisMechanics| mechanics.switches.limits_normally_open = true;
    standing.mechanics.iter_mut().for_each(open);
    let mut talk = Conversation::<B>::open(&standing);
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HardLimit, Some(0)));
    assert_eq!(talk.clear(), Status::Accepted);
    for axis in 0..2 {
        sets(&mut talk, axis, &[(SettingItem::HardLimit, 1)]);
    }
    talk.wait(20_000);
    talk.arm_and_home();
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(500_000);
    talk.board.with_plant(|plant| plant.axis_mut(1).expect("an axis").fix_hard_limit(Some(true)));
    talk.wait(10_000);
    assert!(!talk.board.plant().drivers_on());
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HardLimit, Some(1)));
}

stories!(
    homes_at_the_high_end,
    homes_by_a_normally_closed_switch,
    homes_at_the_high_end_by_a_normally_closed_switch,
    a_broken_wire_of_a_normally_closed_switch_is_noticed,
    an_end_where_no_switch_is_refuses_to_home,
    a_reference_ends_with_the_switch_that_gave_it,
    normally_open_limits_stop_too,
);
