//! Settings in flash, and the power going at every operation.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

use proptest::prelude::*;
use vergence_control::{BoardSettings, Delivered, Flash, FlashError, PAGE, SettingError, UNIT, settings_store};
use vergence_plant::{Cut, RamFlash, bench_settings};
use vergence_protocol::frame::checksum;
use vergence_protocol::{SettingItem, SettingKey};

const SPEED: SettingKey = SettingKey { item: SettingItem::Speed, axis: 1 };

fn defaults() -> BoardSettings {
    BoardSettings::new(&bench_settings()).unwrap()
}

fn delivered() -> Delivered {
    Delivered::for_bench(defaults())
}

/// Settings that differ from others by `speed`.
fn with_speed(speed: u32) -> BoardSettings {
    defaults().with(SPEED, speed.into()).unwrap()
}

/// Flash after `saves` saves.
fn saved(saves: u32) -> RamFlash {
    let mut flash = RamFlash::new(2);
    for save in 0..saves {
        settings_store::save(&mut flash, &with_speed(1_000 + save)).unwrap();
    }
    flash
}

#[test]
fn what_was_saved_last_is_loaded() {
    let mut flash = RamFlash::new(2);
    assert_eq!(settings_store::load(&mut flash, &delivered()), Ok(None), "erased flash");
    for speed in 1..50 {
        let settings = with_speed(speed);
        settings_store::save(&mut flash, &settings).unwrap();
        assert_eq!(settings_store::load(&mut flash, &delivered()), Ok(Some(settings)));
    }
}

#[test]
fn a_cut_at_any_operation_leaves_old_or_new_never_neither() {
    let operations = {
        let mut flash = saved(1);
        let before = flash.operations();
        settings_store::save(&mut flash, &with_speed(7)).unwrap();
        flash.operations() - before
    };
    assert!(operations > 20, "an erase and many units: {operations}");
    let (mut old, mut new) = (0, 0);
    for how in [Cut::Clean, Cut::Torn] {
        for saves in 1..8 {
            for at in 0..=operations {
                let mut flash = saved(saves);
                flash.cut_after(at, how, u64::from(saves) << 32 | at as u64);
                let outcome = settings_store::save(&mut flash, &with_speed(7));
                assert_eq!(outcome.is_ok(), at == operations, "{how:?} {saves} {at}");
                flash.power_on();
                match settings_store::load(&mut flash, &delivered()).unwrap().map(|settings| settings.axes[1].speed) {
                    Some(7) => new += 1,
                    Some(speed) if speed == 999 + saves => old += 1,
                    other => panic!("{how:?} at {at} after {saves} saves: {other:?}"),
                }
                settings_store::save(&mut flash, &with_speed(8)).unwrap();
                assert_eq!(settings_store::load(&mut flash, &delivered()), Ok(Some(with_speed(8))));
            }
        }
    }
    assert!(old > 300 && new > 10, "{old} {new}");
}

/// Power that goes again and again, in whatever save it is.
#[test]
fn over_many_cut_saves_the_last_good_record_survives() {
    for how in [Cut::Clean, Cut::Torn] {
        let mut flash = saved(1);
        let mut kept = 1_000;
        for round in 0..2_000_u32 {
            let speed = 10_000 + round;
            flash.cut_after((round as usize * 7) % 48, how, round.into());
            let outcome = settings_store::save(&mut flash, &with_speed(speed));
            flash.power_on();
            let loaded = settings_store::load(&mut flash, &delivered()).unwrap().unwrap().axes[1].speed;
            assert!(loaded == kept || loaded == speed, "round {round}: {loaded}, not {kept} or {speed}");
            assert!(outcome.is_err() || loaded == speed);
            kept = loaded;
        }
        assert!(kept > 10_000, "some were saved");
    }
}

#[test]
fn sequence_numbers_go_round() {
    let mut flash = saved(2);
    for page in 0..2_u32 {
        // As after four thousand million saves: the last two before zero.
        renumber(&mut flash, page as usize, u32::MAX - 1 + page);
    }
    for speed in [5, 6, 7] {
        settings_store::save(&mut flash, &with_speed(speed)).unwrap();
        assert_eq!(settings_store::load(&mut flash, &delivered()).unwrap().unwrap().axes[1].speed, speed);
    }
}

/// Gives the record in `page` another number.
fn renumber(flash: &mut RamFlash, page: usize, sequence: u32) {
    let mut record = flash.bytes()[page * PAGE..(page + 1) * PAGE].to_vec();
    record[4..8].copy_from_slice(&sequence.to_le_bytes());
    seal(&mut record);
    flash.overwrite(page * PAGE, &record);
}

/// Makes the checksum of a record right.
fn seal(record: &mut [u8]) {
    let end = 12 + u32::from_le_bytes(record[8..12].try_into().unwrap()) as usize;
    let crc = checksum(&record[..end]);
    record[end..end + 4].copy_from_slice(&crc.to_le_bytes());
}

#[test]
fn an_item_of_later_firmware_is_passed_over_and_one_that_is_missing_is_as_delivered() {
    let mut record = vec![0xFF; PAGE];
    record[..8].copy_from_slice(b"VGS1\0\0\0\0");
    // Item 99, axis 0, value 5; speed (item 2) of axis 1 is 777: zigzag 1554.
    let body = [99, 0, 10, 2, 1, 0x92, 0x0c];
    record[8..12].copy_from_slice(&(body.len() as u32).to_le_bytes());
    record[12..12 + body.len()].copy_from_slice(&body);
    seal(&mut record);
    let mut flash = RamFlash::new(2);
    flash.overwrite(0, &record);
    assert_eq!(settings_store::load(&mut flash, &delivered()), Ok(Some(with_speed(777))));
}

#[test]
fn a_record_that_no_axis_can_work_with_is_not_taken() {
    let mut settings = defaults();
    settings.axes[1].speed = 0;
    let mut flash = RamFlash::new(2);
    settings_store::save(&mut flash, &settings).unwrap();
    assert_eq!(settings_store::load(&mut flash, &delivered()), Err(settings_store::SettingsRefused));
}

/// Flash whose words cannot be read, as after an uncorrectable error.
struct Unreadable(RamFlash, usize);

impl Flash for Unreadable {
    fn pages(&self) -> usize {
        self.0.pages()
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        self.0.erase(page)
    }

    fn program(&mut self, at: usize, unit: [u8; UNIT]) -> Result<(), FlashError> {
        self.0.program(at, unit)
    }

    fn read(&mut self, at: usize, into: &mut [u8]) -> Result<(), FlashError> {
        if at / PAGE == self.1 { Err(FlashError) } else { self.0.read(at, into) }
    }
}

#[test]
fn a_page_that_cannot_be_read_is_no_record() {
    let mut flash = Unreadable(saved(2), 1);
    assert_eq!(
        settings_store::load(&mut flash, &delivered()).unwrap().unwrap().axes[1].speed,
        1_000,
        "the older one is left"
    );
    assert_eq!(settings_store::save(&mut flash, &with_speed(7)), Err(FlashError), "what cannot be read is not kept");
}

#[test]
fn every_key_of_a_board_can_be_read_and_no_other() {
    let settings = defaults();
    assert_eq!(settings.keys().count(), 2 * 35 + 5);
    for item in SettingItem::ALL {
        for axis in 0..=u8::MAX {
            let key = SettingKey { item, axis };
            let known = settings.keys().any(|known| known == key);
            assert_eq!(settings.get(key).is_some(), known, "{key:?}");
            if !known {
                assert_eq!(settings.with(key, 1), Err(SettingError::Unknown));
            }
        }
    }
}

#[test]
fn a_value_that_cannot_be_beside_the_others_is_not_taken() {
    let settings = defaults();
    let refused = |item, axis, value| settings.with(SettingKey { item, axis }, value) == Err(SettingError::Value);
    assert!(refused(SettingItem::Min, 0, settings.axes[0].max.0.into()));
    assert!(refused(SettingItem::HomeSwitchAt, 0, settings.axes[0].min.0.into()));
    assert!(refused(SettingItem::Speed, 1, 0));
    assert!(refused(SettingItem::Speed, 1, 1 << 32));
    assert!(refused(SettingItem::Max, 1, i64::from(i32::MAX) + 1));
    assert!(refused(SettingItem::CountsReversed, 1, 2));
    assert!(refused(SettingItem::StreamPeriod, 0, 999));
    assert!(refused(SettingItem::Baud, 0, 300));
    assert!(settings.with(SettingKey { item: SettingItem::StreamPeriod, axis: 0 }, 0).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_setting_changes_itself_and_nothing_else(index in 0..75_usize, value in prop_oneof![any::<i64>(), 0..100_000_i64]) {
        let before = defaults();
        let key = before.keys().nth(index).unwrap();
        if let Ok(after) = before.with(key, value) {
            prop_assert!(after.validate().is_ok());
            for other in before.keys() {
                prop_assert_eq!(after.get(other), if other == key { Some(value) } else { before.get(other) });
            }
            let mut flash = RamFlash::new(2);
            settings_store::save(&mut flash, &after).unwrap();
            // Another machine has other axes.
            prop_assume!(key.item != SettingItem::Machine);
            prop_assert_eq!(settings_store::load(&mut flash, &Delivered::for_bench(before)), Ok(Some(after)));
        }
    }

    #[test]
    fn whatever_is_in_flash_loading_ends_and_saving_works(
        bytes in prop::collection::vec(any::<u8>(), 0..2 * PAGE),
        sealed in any::<bool>(),
        length in 0..(PAGE - 16) as u32,
    ) {
        let mut record = bytes;
        if sealed && record.len() >= PAGE {
            record[..4].copy_from_slice(b"VGS1");
            record[8..12].copy_from_slice(&length.to_le_bytes());
            seal(&mut record[..PAGE]);
        }
        let mut flash = RamFlash::new(2);
        flash.overwrite(0, &record);
        if let Ok(Some(settings)) = settings_store::load(&mut flash, &delivered()) {
            prop_assert!(settings.validate().is_ok());
        }
        settings_store::save(&mut flash, &with_speed(9)).unwrap();
        prop_assert_eq!(settings_store::load(&mut flash, &delivered()), Ok(Some(with_speed(9))));
    }
}
