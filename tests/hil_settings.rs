//! The unmodified firmware on the simulated chip refuses settings by which it could not keep its promises.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod elf_rig;

use elf_rig::{Conversation, ElfBoard, Standing};
use vergence_control::{BoardSettings, Flash, PAGE, settings_store};
use vergence_image::layout::SETTINGS;
use vergence_plant::{RamFlash, bench_settings};
use vergence_protocol::{ControllerState, FaultCode, Micro, Refusal, Report, Request, SettingItem, SettingKey, Status};

type Talk = Conversation<ElfBoard>;

/// Settings of the bench that must be refused: item, axis, value. Axis 0 is the baseline, 60 mm to 220 mm; axis 1 the
/// separation, 0 to 130 degrees. Values in micrometres, microradians, and these per second, per second squared and cubed.
const BAD: [(SettingItem, u8, i64); 36] = [
    (SettingItem::Min, 0, 220_000),                 // An empty range.
    (SettingItem::Min, 0, 57_000),                  // The range reaches the home switch.
    (SettingItem::Max, 0, 60_000),                  // An empty range.
    (SettingItem::Max, 0, 1_000_000_000),           // More steps than a counter holds.
    (SettingItem::Speed, 0, 0),                     // Nothing moves.
    (SettingItem::Speed, 0, -80_000),               // No speed.
    (SettingItem::Speed, 0, 130_000),               // More than 100 000 steps a second.
    (SettingItem::Speed, 1, 1 << 32),               // No number of the firmware's.
    (SettingItem::Acceleration, 0, 0),              // A stop that never ends.
    (SettingItem::Acceleration, 0, 30_000),         // A stop of 2.7 s.
    (SettingItem::Acceleration, 1, 10_000),         // A stop of 105 s.
    (SettingItem::Jerk, 0, 0),                      // A move that never begins.
    (SettingItem::Jerk, 0, 50_000),                 // A stop of 2.5 s.
    (SettingItem::Jerk, 0, 300_000_000),            // A ramp shorter than two ticks.
    (SettingItem::Jerk, 1, 3_000_000_000),          // A ramp shorter than two ticks.
    (SettingItem::StepsPerUnit, 0, 0),              // No motor.
    (SettingItem::StepsPerUnit, 0, 2_000_000),      // More than 100 000 steps a second.
    (SettingItem::StepsPerUnit, 1, 20),             // A step of 18 degrees: no target is reached.
    (SettingItem::CountsPerUnit, 0, 0),             // No encoder.
    (SettingItem::CountsPerUnit, 0, 10_000),        // A count of 0.1 mm: no target is reached.
    (SettingItem::CountsPerUnit, 0, 4_000_000_000), // More counts than a counter holds.
    (SettingItem::StepsReversed, 0, 2),             // Neither yes nor no.
    (SettingItem::FollowingError, 0, 0),            // A fault at rest.
    (SettingItem::FollowingError, 0, 10_000),       // A blocked stage goes unnoticed for 10 mm.
    (SettingItem::FollowingError, 1, 785_398),      // A blocked stage goes unnoticed for 45 degrees.
    (SettingItem::Tolerance, 0, 0),                 // Never settled.
    (SettingItem::Tolerance, 0, 5_000),             // Settled 5 mm away.
    (SettingItem::Tolerance, 1, 10),                // Below a count of the encoder.
    (SettingItem::Backlash, 0, -1),                 // No distance.
    (SettingItem::Backlash, 1, 500_000),            // A run-up of 29 degrees.
    (SettingItem::HomeSwitchAt, 0, 60_000),         // The switch inside the range.
    (SettingItem::HomeSeekSpeed, 0, 0),             // A search that never ends.
    (SettingItem::HomeTravel, 0, 3_000_000),        // A search of three metres.
    (SettingItem::HomeRepeatability, 1, 50_000),    // A reference that is 2.9 degrees off.
    (SettingItem::StreamPeriod, 0, 10),             // Faster than the line.
    (SettingItem::Baud, 0, 300),                    // No serial port has it.
];

fn value_of(talk: &mut Talk, key: SettingKey) -> i64 {
    let Report::Setting { value, .. } = talk.answer(Request::GetSetting(key)) else { panic!("no setting") };
    value
}

#[test]
fn a_setting_that_breaks_a_promise_is_refused_and_changes_nothing() {
    let mut talk = Talk::open(&Standing::default());
    for (item, axis, value) in BAD {
        let key = SettingKey { item, axis };
        let before = value_of(&mut talk, key);
        let refused = talk.ask(Request::SetSetting { key, value });
        assert_eq!(refused, Status::Refused(Refusal::BadSetting), "{} of axis {axis} = {value}", item.name());
        assert_eq!(value_of(&mut talk, key), before);
    }
    assert_eq!(talk.arm(), Status::Accepted);
}

/// As an older firmware might have saved them.
#[test]
fn saved_settings_that_are_refused_are_a_fault_and_not_replaced_in_silence() {
    let mut settings = BoardSettings::new(&bench_settings()).expect("the bench");
    settings.axes[0].speed = 50_000;
    settings.axes[0].tolerance = Micro(5_000);
    let mut flash = RamFlash::new(2);
    settings_store::save(&mut flash, &settings).expect("RAM");
    let mut pages = vec![0; 2 * PAGE];
    flash.read(0, &mut pages).expect("RAM");

    let mut talk = Talk::open(&Standing::default());
    assert!(talk.board.machine.chip_mut().load_flash(SETTINGS.start as usize, &pages));
    let lost = talk.lost;
    talk.board.machine.power_on();
    talk.wait_until("the restart goes unnoticed", |talk| talk.lost > lost);
    talk.reconnect(7);
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (FaultCode::BadSettings, None));
    assert_ne!(talk.arm(), Status::Accepted);

    // The settings in effect are the delivered ones; the saved ones are still in flash until somebody saves.
    let speed = SettingKey { item: SettingItem::Speed, axis: 0 };
    assert_eq!(value_of(&mut talk, speed), i64::from(bench_settings()[0].speed));
    assert_eq!(talk.clear(), Status::Accepted);
    talk.wait_for(ControllerState::Idle);
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    let lost = talk.lost;
    talk.board.machine.power_on();
    talk.wait_until("the restart goes unnoticed", |talk| talk.lost > lost);
    talk.reconnect(8);
    talk.wait_for(ControllerState::Idle);
}
