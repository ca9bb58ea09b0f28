//! Requests besides motion: settings, flight recorder, link statistics, logs, camera trigger.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

mod rigged;

use rigged::Rigged;
use vergence_plant::{Cut, bench_settings};
use vergence_protocol::{
    ControllerState, FaultCode, Happening, Microseconds, MoveId, RecordedEvent, Refusal, Report, Request, ResetCause,
    SettingItem, SettingKey, Status, StopKind, Trigger,
};

const SPEED: SettingKey = SettingKey { item: SettingItem::Speed, axis: 0 };
const STREAM: SettingKey = SettingKey { item: SettingItem::StreamPeriod, axis: 0 };

fn get(rigged: &mut Rigged, key: SettingKey) -> i64 {
    match rigged.answer(Request::GetSetting(key)) {
        Report::Setting { key: named, value, .. } if named == key => value,
        other => panic!("{other:?}"),
    }
}

fn set(rigged: &mut Rigged, key: SettingKey, value: i64) -> Status {
    rigged.ask(Request::SetSetting { key, value })
}

/// All events that the recorder holds.
fn recorded(rigged: &mut Rigged) -> Vec<RecordedEvent> {
    let mut events = Vec::new();
    let mut first = 0;
    loop {
        let Report::Events { events: page, .. } = rigged.answer(Request::GetEvents { first }) else { panic!() };
        if page.events.is_empty() {
            return events;
        }
        first = page.first + page.events.len() as u32;
        events.extend(page.events);
    }
}

/// Switches the power of the board off and on again.
fn power_cycle(rigged: &mut Rigged, session: u32) {
    rigged.board.restart(ResetCause::PowerOn, session).unwrap();
    rigged.board.services_mut().settings.power_on();
    let now = rigged.now;
    rigged.board_starts(now);
    rigged.reconnect(session);
}

#[test]
fn a_setting_works_at_once_and_is_forgotten_unless_saved() {
    let mut rigged = Rigged::off(1).open();
    let delivered = i64::from(bench_settings()[0].speed);
    assert_eq!(get(&mut rigged, SPEED), delivered);
    assert_eq!(set(&mut rigged, SPEED, 50_000), Status::Accepted);
    assert_eq!(get(&mut rigged, SPEED), 50_000);
    let Report::Axis { info, .. } = rigged.answer(Request::GetAxis { axis: 0 }) else { panic!() };
    assert_eq!(info.speed, 50_000);
    power_cycle(&mut rigged, 7);
    assert_eq!(get(&mut rigged, SPEED), delivered);

    assert_eq!(set(&mut rigged, SPEED, 50_000), Status::Accepted);
    assert_eq!(rigged.ask(Request::SaveSettings), Status::Accepted);
    power_cycle(&mut rigged, 8);
    assert_eq!(get(&mut rigged, SPEED), 50_000);

    assert_eq!(rigged.ask(Request::RestoreSettings), Status::Accepted);
    assert_eq!(get(&mut rigged, SPEED), delivered);
    power_cycle(&mut rigged, 9);
    assert_eq!(get(&mut rigged, SPEED), 50_000, "restored but not saved");
}

#[test]
fn settings_change_only_while_disarmed() {
    let mut rigged = Rigged::off(2).open();
    assert_eq!(rigged.arm(), Status::Accepted);
    for request in [Request::SetSetting { key: SPEED, value: 1_000 }, Request::SaveSettings, Request::RestoreSettings] {
        assert_eq!(rigged.ask(request), Status::Refused(Refusal::NotIdle));
    }
    let operations = rigged.board.services_mut().settings.operations();
    assert_eq!(operations, 0, "no flash is written while armed");
    assert_eq!(rigged.ask(Request::Disarm), Status::Accepted);
    assert_eq!(set(&mut rigged, SPEED, 1_000), Status::Accepted);
}

#[test]
fn a_setting_that_makes_no_sense_is_refused_with_its_reason() {
    let mut rigged = Rigged::off(3).open();
    let nothing = SettingKey { axis: 9, ..SPEED };
    assert_eq!(set(&mut rigged, SPEED, 0), Status::Refused(Refusal::BadSetting));
    assert_eq!(set(&mut rigged, nothing, 1), Status::Refused(Refusal::NoSetting));
    assert_eq!(rigged.ask(Request::GetSetting(nothing)), Status::Refused(Refusal::NoSetting));
    assert_eq!(get(&mut rigged, SPEED), i64::from(bench_settings()[0].speed));
}

#[test]
fn a_board_drives_another_machine_from_its_next_start_on() {
    let mut rigged = Rigged::off(3).open();
    let machine = SettingKey { item: SettingItem::Machine, axis: 0 };
    assert_eq!(get(&mut rigged, machine), 0, "the bench from the factory");
    assert_eq!(set(&mut rigged, machine, 2), Status::Refused(Refusal::BadSetting));
    assert_eq!(set(&mut rigged, machine, 1), Status::Accepted);
    assert_eq!(rigged.info().axes, 2);
    assert_eq!(rigged.arm(), Status::Refused(Refusal::NoSuchMachine));
    assert_eq!(set(&mut rigged, machine, 0), Status::Accepted);
    assert_eq!(rigged.arm(), Status::Accepted, "it was not saved");
    assert_eq!(rigged.ask(Request::Disarm), Status::Accepted);

    assert_eq!(set(&mut rigged, machine, 1), Status::Accepted);
    assert_eq!(rigged.ask(Request::SaveSettings), Status::Accepted);
    power_cycle(&mut rigged, 7);
    assert_eq!((rigged.info().axes, get(&mut rigged, machine)), (5, 1));
    let servo = |axis| SettingKey { item: SettingItem::ServoId, axis };
    assert_eq!([0, 1, 2, 3, 4].map(|axis| get(&mut rigged, servo(axis))), [13, 14, 15, 16, 17]);
    rigged.wait(1_000_000);
    let why = Some(FaultCode::DriverSilent);
    assert_eq!(rigged.arm(), Status::Refused(Refusal::DriverNotReady { axis: 0, why }), "no servo is there");
    assert_eq!(set(&mut rigged, servo(1), 13), Status::Refused(Refusal::BadSetting), "two servos of one number");
    let driver = SettingKey { item: SettingItem::Driver, axis: 0 };
    assert_eq!(set(&mut rigged, driver, 0), Status::Refused(Refusal::BadSetting), "a joint stays one");

    // Back, with the settings of the bench as delivered.
    assert_eq!(rigged.ask(Request::RestoreSettings), Status::Accepted);
    assert_eq!(get(&mut rigged, machine), 1);
    assert_eq!(set(&mut rigged, machine, 0), Status::Accepted);
    assert_eq!(rigged.ask(Request::SaveSettings), Status::Accepted);
    power_cycle(&mut rigged, 8);
    assert_eq!(get(&mut rigged, SPEED), i64::from(bench_settings()[0].speed));
    assert_eq!(rigged.arm(), Status::Accepted);
}

#[test]
fn settings_that_cannot_be_written_are_refused_and_the_old_ones_stay() {
    let mut rigged = Rigged::off(4).open();
    set(&mut rigged, SPEED, 50_000);
    assert_eq!(rigged.ask(Request::SaveSettings), Status::Accepted);
    set(&mut rigged, SPEED, 60_000);
    rigged.board.services_mut().settings.cut_after(10, Cut::Torn, 1);
    assert_eq!(rigged.ask(Request::SaveSettings), Status::Refused(Refusal::StorageFailed));
    power_cycle(&mut rigged, 7);
    assert_eq!(get(&mut rigged, SPEED), 50_000);
}

#[test]
fn a_reference_is_lost_only_where_its_zero_would_be_elsewhere() {
    let mut rigged = Rigged::homed(5);
    assert_eq!(rigged.ask(Request::Disarm), Status::Accepted);
    assert_eq!(set(&mut rigged, SPEED, 50_000), Status::Accepted);
    rigged.wait(20_000);
    assert_eq!(rigged.pose().referenced, rigged::BOTH);
    let scale = SettingKey { item: SettingItem::CountsPerUnit, axis: 1 };
    assert_eq!(set(&mut rigged, scale, 100_001), Status::Accepted);
    rigged.wait(20_000);
    assert_eq!(rigged.pose().referenced.0, 1);
}

#[test]
fn poses_stream_at_their_set_period_from_the_opening_on() {
    let mut rigged = Rigged::off(6).open();
    set(&mut rigged, STREAM, 20_000);
    rigged.host = vergence_protocol::HostSession::new(vergence_protocol::SessionId(3));
    rigged.host.hello();
    rigged.wait(100_000);
    let before = rigged.host.statistics().poses;
    rigged.wait(1_000_000);
    assert_eq!(rigged.host.statistics().poses - before, 50);
}

#[test]
fn the_recorder_tells_what_led_to_a_fault() {
    let mut rigged = Rigged::homed(10);
    assert_eq!(rigged.move_to([100_000, 200_000], 1), Status::Accepted);
    rigged.wait(200_000);
    assert_eq!(rigged.ask(Request::Home { axes: rigged::BOTH }), Status::Refused(Refusal::Busy));
    rigged.board.plant_mut().block(0, true);
    rigged.wait_for(ControllerState::Fault);
    let events: Vec<Happening> = recorded(&mut rigged).into_iter().map(|event| event.what).collect();
    let at = |what: Happening| {
        events.iter().position(|&event| event == what).unwrap_or_else(|| panic!("no {what:?} in {events:?}"))
    };
    let story = [
        at(Happening::Started),
        at(Happening::Opened(rigged.host.id())),
        at(Happening::State(ControllerState::Homing)),
        at(Happening::Move(MoveId(1))),
        at(Happening::State(ControllerState::Moving)),
        at(Happening::Refused(Refusal::Busy)),
        at(Happening::State(ControllerState::Fault)),
    ];
    assert!(story.is_sorted(), "{events:?}");
    let home_switch =
        events.iter().any(|event| matches!(event, Happening::Switch { axis: 0, home: true, operated: true }));
    assert!(home_switch, "homing closed the switch: {events:?}");
    let fault = events.iter().position(|event| matches!(event, Happening::Fault { axis: Some(0), .. })).unwrap();
    let counts: Vec<_> = events[fault + 1..fault + 3].to_vec();
    assert!(matches!(counts[..], [Happening::Encoder { axis: 0, .. }, Happening::Encoder { axis: 1, .. }]));
}

#[test]
fn what_led_to_a_fault_stays_whatever_the_host_asks_afterwards() {
    let mut rigged = Rigged::homed(11);
    rigged.board.plant_mut().press_emergency_stop(true);
    rigged.wait_for(ControllerState::Fault);
    for _ in 0..200 {
        assert_eq!(rigged.ask(Request::Home { axes: rigged::BOTH }), Status::Refused(Refusal::Latched));
    }
    let is_fault =
        |event: &RecordedEvent| matches!(event.what, Happening::Fault { code: FaultCode::EmergencyStop, .. });
    let events = recorded(&mut rigged);
    assert!(events.len() <= 64 && events.iter().any(is_fault), "{events:?}");
    assert_ne!(events[0].what, Happening::Refused(Refusal::Latched), "something before the fault is left");
    rigged.board.plant_mut().press_emergency_stop(false);
    assert_eq!(rigged.clear(), Status::Accepted);
    assert_eq!(rigged.ask(Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    let events = recorded(&mut rigged);
    assert_eq!(events.last().unwrap().what, Happening::Stop(StopKind::Decelerate), "it records on");
    let times: Vec<Microseconds> = events.iter().map(|event| event.at).collect();
    assert!(times.is_sorted());
}

#[test]
fn the_ring_keeps_the_last_64() {
    let mut rigged = Rigged::off(12).open();
    for _ in 0..100 {
        rigged.ask(Request::Home { axes: rigged::BOTH });
    }
    let events = recorded(&mut rigged);
    assert_eq!(events.len(), 64);
    assert!(events.iter().all(|event| event.what == Happening::Refused(Refusal::NotArmed)));
    let Report::Events { events: page, .. } = rigged.answer(Request::GetEvents { first: 0 }) else { panic!() };
    assert_eq!(page.first, page.total - 64, "the answer says where it begins");
}

#[test]
fn the_board_tells_its_link_figures() {
    let mut rigged = Rigged::off(13).open();
    rigged.board.receive(&[1, 2, 3, 4, 0]);
    rigged.board.receive(&[9, 9, 0]);
    let Report::Statistics { statistics, .. } = rigged.answer(Request::GetStatistics) else { panic!() };
    assert_eq!(statistics.link.dropped(), 2);
    assert!(statistics.sent > 0 && statistics.link.frames > 0, "{statistics:?}");
}

#[test]
fn the_log_arrives_whole() {
    let mut rigged = Rigged::off(14).open();
    rigged.wait(20_000);
    let text = b"a line of log that is longer than one frame takes, and then some more of it\n";
    rigged.board.log(text);
    rigged.board.log(b"end");
    rigged.wait(20_000);
    assert_eq!(rigged.log, [&text[..], b"end"].concat());
}

#[test]
fn cameras_fire_on_a_grid_that_does_not_drift() {
    let mut rigged = Rigged::off(20).open();
    let period_us = 33_333;
    assert_eq!(rigged.ask(Request::SetTrigger(Trigger::Every { period_us })), Status::Accepted);
    rigged.wait(10_000_000);
    let start = rigged.marks[0].at.0;
    assert!(rigged.marks.len() >= 300, "{}", rigged.marks.len());
    for (number, mark) in rigged.marks.iter().enumerate() {
        assert_eq!(mark.seq, number as u32);
        assert_eq!(mark.at.0, start + number as u64 * u64::from(period_us));
        assert_eq!(mark.counts.len(), 2);
    }
    assert_eq!(rigged.ask(Request::SetTrigger(Trigger::Off)), Status::Accepted);
    let fired = rigged.marks.len();
    rigged.wait(1_000_000);
    assert!(rigged.marks.len() <= fired + 1);
}

#[test]
fn one_picture_says_where_the_stages_were() {
    let mut rigged = Rigged::homed(21);
    assert_eq!(rigged.ask(Request::SetTrigger(Trigger::Once)), Status::Accepted);
    rigged.wait(50_000);
    let [mark] = &rigged.marks[..] else { panic!("{:?}", rigged.marks) };
    assert_eq!((mark.seq, &mark.counts), (0, &rigged.pose().counts), "as in a Pose");
}

#[test]
fn a_trigger_too_quick_or_too_slow_is_refused_and_a_new_session_begins_without() {
    let mut rigged = Rigged::off(22).open();
    for period_us in [0, 1, 1_999, 10_000_001, u32::MAX] {
        let trigger = Request::SetTrigger(Trigger::Every { period_us });
        assert_eq!(rigged.ask(trigger), Status::Refused(Refusal::Invalid));
    }
    assert_eq!(rigged.ask(Request::SetTrigger(Trigger::Every { period_us: 2_000 })), Status::Accepted);
    rigged.wait(1_000_000);
    assert!(rigged.marks.len() >= 499, "{}", rigged.marks.len());
    rigged.reconnect(3);
    rigged.marks.clear();
    rigged.wait(1_000_000);
    assert_eq!(rigged.marks, []);
}
