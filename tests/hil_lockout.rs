//! No setting locks a host out of the unmodified firmware on the simulated chip: a speed of the line that nobody can make
//! goes back, and a speed that nobody knows is found.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Conversation, ElfBoard, Standing};
use vergence_control::{BoardSettings, Flash, PAGE, settings_store};
use vergence_image::layout::{HARDWARE, IMAGE, SETTINGS};
use vergence_mcu::{Drive, Pin};
use vergence_plant::{RamFlash, bench_settings};
use vergence_protocol::management::{
    BootState, Identity, ImageHeader, Management, ManagementReport, Outcome, RebootTo,
};
use vergence_protocol::{ControllerState, FaultCode, Report, Request, SettingItem, SettingKey, Status};

type Talk = Conversation<ElfBoard>;

const FACTORY: u32 = 921_600;
const FAST: u32 = 2_000_000;
const BAUD: SettingKey = SettingKey { item: SettingItem::Baud, axis: 0 };

fn baud_of(talk: &mut Talk) -> i64 {
    let Report::Setting { value, .. } = talk.answer(Request::GetSetting(BAUD)) else { panic!("no setting") };
    value
}

fn set_baud(talk: &mut Talk, baud: u32) -> Status {
    talk.ask(Request::SetSetting { key: BAUD, value: baud.into() })
}

/// Seconds of the host's clock until a new session is open.
fn seconds_to_reconnect(talk: &mut Talk, id: u32) -> f64 {
    let start = talk.now.0;
    talk.reconnect(id);
    (talk.now.0 - start) as f64 * 1e-6
}

/// A board that starts with this speed saved, and a host at the speed of the factory.
fn with_saved(baud: u32) -> Talk {
    let mut settings = BoardSettings::new(&bench_settings()).expect("the bench");
    settings.baud = baud;
    let mut flash = RamFlash::new(2);
    settings_store::save(&mut flash, &settings).expect("RAM");
    let mut pages = vec![0; 2 * PAGE];
    flash.read(0, &mut pages).expect("RAM");
    let mut talk = Talk::off(&Standing::default());
    assert!(talk.board.machine.chip_mut().load_flash(SETTINGS.start as usize, &pages));
    talk.board.machine.power_on();
    talk
}

#[test]
fn a_speed_that_the_host_cannot_make_goes_back_and_cannot_be_saved() {
    let mut talk = Talk::open(&Standing::default());
    assert_eq!(set_baud(&mut talk, FAST), Status::Accepted);
    talk.wait(100_000);
    assert_eq!(talk.board.heard_baud, FAST, "the board has changed");
    // Whoever did not hear it asks on at the old speed. The answer comes once the board has returned.
    let start = talk.now.0;
    assert_eq!(baud_of(&mut talk), i64::from(FACTORY));
    println!("answered at the old speed after {:.2} s", (talk.now.0 - start) as f64 * 1e-6);
    assert!((4_500_000..6_000_000).contains(&(talk.now.0 - start)));
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    talk.board.machine.press_reset();
    println!("after a reset {:.2} s", seconds_to_reconnect(&mut talk, 7));
    assert_eq!(baud_of(&mut talk), i64::from(FACTORY));
}

#[test]
fn a_speed_at_which_a_host_is_heard_stays_and_can_be_saved() {
    let mut talk = Talk::open(&Standing::default());
    assert_eq!(set_baud(&mut talk, FAST), Status::Accepted);
    talk.board.baud = FAST;
    println!("at the new speed after {:.2} s", seconds_to_reconnect(&mut talk, 7));
    assert_eq!(baud_of(&mut talk), i64::from(FAST));
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    talk.wait(6_000_000);
    assert_eq!((talk.board.heard_baud, talk.host.statistics().poses_lost), (FAST, 0));
    talk.board.machine.press_reset();
    seconds_to_reconnect(&mut talk, 8);
    assert_eq!(talk.board.heard_baud, FAST);
    talk.wait(500_000);
    assert_eq!(talk.host.statistics().poses_lost, 0);
}

/// A host that asks at the speed of the factory, as all do that were not told another one.
#[test]
fn a_saved_speed_that_nobody_knows_does_not_keep_a_host_out() {
    let mut talk = with_saved(FAST);
    let seconds = seconds_to_reconnect(&mut talk, 7);
    println!("found at the speed of the factory after {seconds:.2} s");
    assert!(seconds < 2.5, "within the patience of a host that opens a session and the start of the board");
    assert_eq!(baud_of(&mut talk), i64::from(FAST));

    // It stays there while this host is there, and later one that knows the saved speed finds it too.
    talk.wait(6_000_000);
    assert!(talk.board.heard_baud.abs_diff(FACTORY) < FACTORY / 1_000);
    talk.alive = false;
    talk.wait(6_000_000);
    talk.board.baud = FAST;
    let seconds = seconds_to_reconnect(&mut talk, 8);
    println!("found at the saved speed after {seconds:.2} s");
    assert!(seconds < 2.0);
    assert_eq!(set_baud(&mut talk, FACTORY), Status::Accepted);
    talk.board.baud = FACTORY;
    seconds_to_reconnect(&mut talk, 9);
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
}
/// Noise and a host at another speed make framing errors.
#[test]
fn line_errors_cost_the_frames_that_they_hit_and_no_more() {
    let mut talk = Talk::open(&Standing::default());
    talk.board.baud = FAST;
    talk.wait(300_000);
    talk.board.baud = FACTORY;
    for _ in 0..20 {
        let start = talk.now.0;
        baud_of(&mut talk);
        assert!(talk.now.0 - start < 300_000, "{} us", talk.now.0 - start);
    }
}

/// The blue button of the NUCLEO board.
const BUTTON: &str = "PC13";

/// Asks again until somebody answers, as every tool that updates a board does.
fn manage(talk: &mut Talk, request: &Management) -> ManagementReport {
    talk.management.clear();
    for _ in 0..20 {
        talk.host.manage(request.clone()).expect("the line takes it");
        talk.wait(300_000);
        if !talk.management.is_empty() {
            return talk.management.remove(0);
        }
    }
    panic!("nobody answers {request:?}");
}

fn identity(talk: &mut Talk) -> Identity {
    let ManagementReport::Identity(identity) = manage(talk, &Management::Identify) else { panic!("no identity") };
    identity
}

/// Whatever is saved, somebody with a finger gets in.
#[test]
fn the_button_at_reset_leads_to_recovery_and_to_the_settings_of_the_factory() {
    let button = Pin::named(BUTTON).expect("a pin");
    let mut talk = with_saved(FAST);
    // Not pressed, it starts as ever.
    assert_eq!(identity(&mut talk).boot, BootState::Confirmed);
    talk.board.machine.chip_mut().drive(button, Drive::High);
    talk.board.machine.press_reset();
    talk.wait(500_000);
    talk.board.machine.chip_mut().drive(button, Drive::Floating);
    assert_eq!(identity(&mut talk).boot, BootState::Recovery);
    let restarted = manage(&mut talk, &Management::Reboot(RebootTo::Application));
    assert!(matches!(restarted, ManagementReport::Progress { outcome: Outcome::Done, .. }), "{restarted:?}");
    println!("the application answers after {:.2} s", seconds_to_reconnect(&mut talk, 7));
    assert!(talk.board.heard_baud.abs_diff(FACTORY) < FACTORY / 1_000, "{}", talk.board.heard_baud);
    // Nobody moves with other settings than the saved ones unnoticed.
    assert_eq!((talk.pose().state, talk.fault().code), (ControllerState::Fault, FaultCode::BadSettings));
    assert_eq!(baud_of(&mut talk), i64::from(FACTORY));
    assert_eq!(talk.clear(), Status::Accepted);
    talk.wait_for(ControllerState::Idle);

    // Once: the next start has the saved settings again, unless others were saved.
    talk.board.machine.press_reset();
    seconds_to_reconnect(&mut talk, 8);
    assert_eq!((talk.pose().fault, baud_of(&mut talk)), (None, i64::from(FAST)));
}

#[test]
fn recovery_refuses_what_is_older_than_the_installed_application_accepts() {
    let mut talk = with_saved(FACTORY);
    assert_eq!(identity(&mut talk).oldest, [0, 1, 0]);
    manage(&mut talk, &Management::Reboot(RebootTo::Recovery));
    talk.wait(1_000_000);
    let recovery = identity(&mut talk);
    assert_eq!((recovery.boot, recovery.oldest), (BootState::Recovery, [0, 1, 0]));
    let begin = |version| {
        Management::Begin(ImageHeader { hardware: HARDWARE, version, length: 1_000, ..ImageHeader::default() })
    };
    let outcome = |report| match report {
        ManagementReport::Progress { outcome, .. } => outcome,
        other => panic!("{other:?}"),
    };
    assert_eq!(outcome(manage(&mut talk, &begin([0, 0, 9]))), Outcome::TooOld);
    assert_eq!(outcome(manage(&mut talk, &begin([0, 1, 0]))), Outcome::Done);
    // A board without a whole application takes whatever is signed: nothing says what it would accept.
    assert!(talk.board.machine.chip_mut().load_flash(IMAGE.start as usize + 0x4000, &[0; 64]));
    talk.board.machine.press_reset();
    talk.wait(1_000_000);
    assert_eq!(identity(&mut talk).oldest, [0; 3]);
    assert_eq!(outcome(manage(&mut talk, &begin([0, 0, 9]))), Outcome::Done);
}
