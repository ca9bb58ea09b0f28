//! Homing without a switch: StallGuard of the TMC2209 finds the end stop and the encoder confirms it; on the native board and
//! on the unmodified firmware, which reads the driver's output DIAG at the pin of the home switch.
//!
//! `VERGENCE_HOMINGS=100` homes that often.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing, stories};
use vergence_plant::{NativeBoard, StopMechanics, bench_settings};
use vergence_protocol::{
    AxisMask, ControllerState, FaultCode, Jog, Micro, MoveId, MovePhase, Permille, Refusal, Request, SettingItem,
    SettingKey, Status,
};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
const MICROSTEPS: u32 = 8;
/// Time in which drivers get their settings, in microseconds.
const SETTING_US: u64 = 200_000;
/// The end stops at home: the low one of the baseline, the high one of the separation.
const STOPS: [f64; 2] = [57_000.0, 2_330_000.0];
/// How far they yield to the motor, and four full steps of it.
const GIVES: [StopMechanics; 2] =
    [StopMechanics { give: 30.0, fall_back: 40.0 }, StopMechanics { give: 1_500.0, fall_back: 3_141.6 }];
/// Between what the simulated motors give freely and held: 210 and 42, 76 and 14.
const THRESHOLDS: [i64; 2] = [50, 20];
const STALL_GUARD: i64 = 2;
/// Homings in the normal run.
const HOMINGS: usize = 3;

fn set<B: Board>(talk: &mut Conversation<B>, axis: u8, item: SettingItem, value: i64) -> Status {
    talk.ask(Request::SetSetting { key: SettingKey { item, axis }, value })
}

fn sets<B: Board>(talk: &mut Conversation<B>, axis: u8, settings: &[(SettingItem, i64)]) {
    for &(item, value) in settings {
        assert_eq!(set(talk, axis, item, value), Status::Accepted, "{} = {value}", item.name());
    }
}

/// Stages at these places, without home switches, without hard limits before their end stops, and with DIAG on the lines.
fn without_switches<B: Board>(at: [f64; 2]) -> Conversation<B> {
    let mut standing = Standing { at, ..Standing::default() };
    for (axis, mechanics) in standing.mechanics.iter_mut().enumerate() {
        mechanics.hard_limits = [-1e9, 1e9];
        mechanics.end_stops[axis] = STOPS[axis];
        mechanics.stop = GIVES[axis];
    }
    let mut talk = Conversation::<B>::off(&standing);
    for axis in 0..2 {
        talk.board.with_plant(|plant| {
            plant.drivers_mut().attach(axis, MICROSTEPS);
            plant.wire_diag(usize::from(axis));
        });
    }
    talk.connect();
    talk
}

/// The board knows of it.
fn told<B: Board>(at: [f64; 2], thresholds: [i64; 2]) -> Conversation<B> {
    let mut talk = without_switches::<B>(at);
    for (axis, (threshold, stop)) in (0..).zip(thresholds.into_iter().zip(STOPS)) {
        let switch = [
            (SettingItem::Driver, 1),
            (SettingItem::StallThreshold, threshold),
            (SettingItem::HomeSwitch, STALL_GUARD),
            (SettingItem::HomeSwitchAt, stop.round() as i64),
            (SettingItem::HomeEnd, axis.into()),
        ];
        sets(&mut talk, axis, &switch);
    }
    talk.wait(SETTING_US);
    talk
}

/// Begins homing of one axis.
fn begins<B: Board>(talk: &mut Conversation<B>, axis: u8) {
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.ask(Request::Home { axes: AxisMask(1 << axis) }), Status::Accepted);
}

/// Where each axis truly stands when it is at home, less where it should; in micro-units.
fn off_home<B: Board>(talk: &Conversation<B>) -> [f64; 2] {
    let [baseline, separation] = bench_settings();
    let [a, b] = talk.loads();
    [a - f64::from(baseline.min.0), b - f64::from(separation.max.0)]
}

/// From several places, both ends: always the same reference, within `home_repeatability`, and moves settle.
fn an_axis_without_switch_homes_by_stall<B: Board>(board: &str) {
    let count = std::env::var("VERGENCE_HOMINGS").ok().and_then(|text| text.parse().ok()).unwrap_or(HOMINGS);
    let mut talk = told::<B>([75_000.0, 2_200_000.0], THRESHOLDS);
    let mut found = Vec::new();
    for round in 0..count {
        talk.arm_and_home();
        talk.wait(50_000);
        found.push(off_home(&talk));
        // Elsewhere each time: 0.37 mm and 0.01 rad are no multiples of full steps or ticks.
        let away = [10_000 + 370 * (round as i32 % 20), -(100_000 + 10_000 * (round as i32 % 20))];
        assert_eq!(talk.jog(away), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        assert_eq!(talk.faults.len(), 0, "{:?}", talk.faults);
    }
    for (axis, settings) in bench_settings().iter().enumerate() {
        let places: Vec<_> = found.iter().map(|off| off[axis]).collect();
        let [low, high] = [f64::min, f64::max].map(|extreme| places.iter().copied().reduce(extreme).expect("some"));
        println!("{board}, axis {axis}, {count} homings: {low:.1} to {high:.1} um or urad off");
        assert!(high - low <= f64::from(settings.homing.repeatability.0), "{places:?}");
        let allowed = GIVES[axis].give + f64::from(settings.tolerance.0) + 120.0;
        assert!(low.abs().max(high.abs()) <= allowed, "{places:?}");
    }
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.faults.len()), (MovePhase::Settled, 0), "{:?}", talk.faults);
}

/// An axis that stands at its end stop has no way to get its speed: it backs off first.
fn an_axis_that_stands_at_its_stop_homes_too<B: Board>() {
    for from in [0.0, 300.0, 2_000.0] {
        let mut talk = told::<B>([STOPS[0] + from, 2_200_000.0], THRESHOLDS);
        begins(&mut talk, 0);
        talk.wait_for(ControllerState::Ready);
        assert_eq!(talk.pose().referenced, AxisMask(1), "{:?}", talk.faults);
        let [off, _] = off_home(&talk);
        assert!(off.abs() < 50.0, "{off} from {from}");
    }
}

/// A threshold above what the motor gives freely: the driver reports a stall in the open, and the encoder says otherwise.
fn a_threshold_that_is_too_high_is_named<B: Board>() {
    for (axis, threshold) in [(0, 120), (1, 60)] {
        let mut talk = told::<B>([150_000.0, 1_000_000.0], [threshold; 2]);
        let before = talk.loads();
        begins(&mut talk, axis);
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::DriverStall, Some(axis)));
        assert_eq!(talk.pose().referenced, AxisMask(0));
        talk.wait(300_000);
        let axis = usize::from(axis);
        let homing = bench_settings()[axis].homing;
        let gone = (talk.loads()[axis] - before[axis]).abs();
        assert!(gone < f64::from(homing.seek_speed), "it stopped at once: {gone}");
    }
}

/// A threshold below what a held motor gives: no report ever comes. The encoder ends the press, and says where.
fn a_threshold_that_is_too_low_ends_the_press<B: Board>() {
    for (axis, threshold) in [(0, 10), (1, 4)] {
        let mut talk = told::<B>([75_000.0, 2_200_000.0], [threshold; 2]);
        begins(&mut talk, axis);
        let index = usize::from(axis);
        let settings = bench_settings()[index];
        let is_pressed = |talk: &Conversation<B>| (talk.loads()[index] - STOPS[index]) * [-1.0, 1.0][index] > 0.0;
        talk.wait_until("the stop is not met", is_pressed);
        let (met, at) = (talk.now.0, talk.steps()[index]);
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::StallMissed, Some(axis)));
        assert_eq!(talk.pose().referenced, AxisMask(0));
        // Half of `following_error`, the lag of the load, and two ticks that were ordered.
        let steps = f64::from(talk.steps()[index].abs_diff(at));
        let way = steps * f64::from(settings.motor().position_at(1_000_000).0) * 1e-6;
        let speed = f64::from(settings.homing.seek_speed);
        let allowed = f64::from(settings.following_error.0) / 2.0 + 6e-3 * speed;
        println!("pressed for {:.1} ms and {way:.0} um or urad", (talk.now.0 - met) as f64 * 1e-3);
        assert!(way <= allowed, "{way} of {allowed}");
    }
}

/// A broken wire of DIAG is pulled up, and looks like a stall at rest.
fn a_broken_wire_of_diag_is_noticed_before_anything_moves<B: Board>() {
    let mut talk = told::<B>([75_000.0, 2_200_000.0], THRESHOLDS);
    talk.board.with_plant(|plant| plant.break_diag(0));
    let before = talk.loads();
    begins(&mut talk, 0);
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::HomeSwitchStuck, Some(0)));
    assert!((talk.loads()[0] - before[0]).abs() < 1.0);
}

/// An end stop that is not there: the search has an end.
fn a_stop_that_is_not_there_is_not_found<B: Board>() {
    let mut talk = told::<B>([75_000.0, 2_200_000.0], THRESHOLDS);
    sets(&mut talk, 0, &[(SettingItem::HomeTravel, 30_000), (SettingItem::HomeEnd, 1)]);
    sets(&mut talk, 0, &[(SettingItem::HomeSwitchAt, 230_000)]);
    begins(&mut talk, 0);
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().detail), (FaultCode::HomeSwitchNotFound, 30_000));
}

/// With the watch a stall is a fault as soon as the driver knows of it; without, the encoder finds it later.
fn a_stall_in_a_move_is_a_fault_where_it_is_watched<B: Board>() {
    for (watch, code) in [(1, FaultCode::DriverStall), (0, FaultCode::Stall)] {
        let mut talk = told::<B>([75_000.0, 2_200_000.0], THRESHOLDS);
        sets(&mut talk, 0, &[(SettingItem::StallWatch, watch), (SettingItem::FollowingError, 8_000)]);
        talk.arm_and_home();
        assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        assert_eq!((talk.pose().phase, talk.faults.len()), (MovePhase::Settled, 0), "a free way is no stall");
        let by = [60_000, 0].map(Micro).into_iter().collect();
        assert_eq!(talk.ask(Request::Jog(Jog { id: MoveId(9), by, speed: Permille(500) })), Status::Accepted);
        talk.wait(600_000);
        assert_eq!(talk.pose().state, ControllerState::Moving);
        talk.board.with_plant(|plant| plant.block(0, true));
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (code, Some(0)));
        assert!(!talk.board.plant().drivers_on() && talk.pose().referenced.0 == 0);
    }
}

/// StallGuard works with StealthChop, from a turn a second on, and only where the motor may press for some full steps.
fn settings_with_which_stall_guard_cannot_work_are_refused<B: Board>() {
    let mut talk = told::<B>([75_000.0, 2_200_000.0], THRESHOLDS);
    let bad = [
        (SettingItem::StealthChop, 0),       // StallGuard4 measures with StealthChop only.
        (SettingItem::Driver, 0),            // A plain driver has no StallGuard.
        (SettingItem::StallThreshold, 0),    // Never a stall.
        (SettingItem::HomeSeekSpeed, 2_600), // 260 full steps a second.
        (SettingItem::Speed, 2_600),         // Homing is never faster.
        (SettingItem::Microsteps, 256),      // 8 microsteps of the scale are a 32nd of a full step then.
        (SettingItem::FollowingError, 150),  // 15 full steps.
    ];
    for (item, value) in bad {
        let refused = set(&mut talk, 0, item, value);
        assert_eq!(refused, Status::Refused(Refusal::BadSetting), "{} = {value}", item.name());
    }
    sets(&mut talk, 0, &[(SettingItem::HomeSeekSpeed, 2_680), (SettingItem::FollowingError, 170)]);
}

#[test]
fn the_native_board_homes_by_stall() {
    an_axis_without_switch_homes_by_stall::<NativeBoard>("native board");
}

#[test]
fn the_firmware_homes_by_stall() {
    an_axis_without_switch_homes_by_stall::<ElfBoard>("firmware");
}

stories!(
    an_axis_that_stands_at_its_stop_homes_too,
    a_threshold_that_is_too_high_is_named,
    a_threshold_that_is_too_low_ends_the_press,
    a_broken_wire_of_diag_is_noticed_before_anything_moves,
    a_stop_that_is_not_there_is_not_found,
    a_stall_in_a_move_is_a_fault_where_it_is_watched,
    settings_with_which_stall_guard_cannot_work_are_refused,
);
