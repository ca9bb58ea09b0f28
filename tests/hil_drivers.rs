//! TMC2209 motor drivers: their settings, and what becomes of an axis whose driver fails, on the native board and on the
//! unmodified firmware, which talks to them over the port of the simulated chip.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing, stories};
use vergence_mcu::UartId;
use vergence_plant::{DriverFaults, NativeBoard, Tmc2209};
use vergence_protocol::{
    ControllerState, DriverState, FaultCode, Jog, Micro, MoveId, MovePhase, Permille, Refusal, Report, Request,
    SettingItem, SettingKey, Status,
};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
const NARROW: [i32; 2] = [70_000, 100_000];
/// Microsteps that the bench's scales count.
const MICROSTEPS: u32 = 8;
/// Time in which drivers get their settings, and in which a failed one is tried again, in microseconds.
const SETTING_US: u64 = 200_000;
const AGAIN_US: u64 = 400_000;

/// Both axes with such drivers.
fn with_chips<B: Board>() -> Conversation<B> {
    let mut talk = Conversation::<B>::off(&Standing::default());
    for axis in 0..2 {
        talk.board.with_plant(|plant| plant.drivers_mut().attach(axis, MICROSTEPS));
    }
    talk.connect();
    talk
}

fn set<B: Board>(talk: &mut Conversation<B>, item: SettingItem, axis: u8, value: i64) -> Status {
    talk.ask(Request::SetSetting { key: SettingKey { item, axis }, value })
}

fn use_chips<B: Board>(talk: &mut Conversation<B>) {
    for axis in 0..2 {
        assert_eq!(set(talk, SettingItem::Driver, axis, 1), Status::Accepted);
    }
}

/// Both drivers have their settings.
fn set_up<B: Board>() -> Conversation<B> {
    let mut talk = with_chips::<B>();
    use_chips(&mut talk);
    talk.wait(SETTING_US);
    assert_eq!([0, 1].map(|axis| state(&mut talk, axis)), [DriverState::Ready; 2]);
    talk
}

/// Armed, without reference.
fn armed<B: Board>() -> Conversation<B> {
    let mut talk = set_up::<B>();
    assert_eq!(talk.arm(), Status::Accepted);
    talk
}

/// Armed and in motion.
fn under_way<B: Board>() -> Conversation<B> {
    let mut talk = armed::<B>();
    let by = [30_000, 300_000].map(Micro).into_iter().collect();
    assert_eq!(talk.ask(Request::Jog(Jog { id: MoveId(1), by, speed: Permille::FULL })), Status::Accepted);
    talk.wait(200_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

fn state<B: Board>(talk: &mut Conversation<B>, axis: u8) -> DriverState {
    match talk.answer(Request::GetDriver { axis }) {
        Report::Driver { state, .. } => state,
        other => panic!("{other:?}"),
    }
}

fn with_chip<B: Board>(talk: &mut Conversation<B>, axis: usize, act: impl FnOnce(&mut Tmc2209)) {
    talk.board.with_plant(|plant| act(plant.drivers_mut().chip_mut(axis).expect("a driver")));
}

fn chip<B: Board>(talk: &Conversation<B>, axis: usize) -> &Tmc2209 {
    talk.board.plant().drivers().chip(axis).expect("a driver")
}

/// The fault of `axis` ended with motors without power and positions unknown.
fn is_cut_by<B: Board>(talk: &mut Conversation<B>, axis: u8, code: FaultCode) {
    talk.wait_for(ControllerState::Fault);
    assert_eq!((talk.fault().code, talk.fault().axis), (code, Some(axis)));
    assert!(!talk.board.plant().drivers_on() && talk.pose().referenced.0 == 0);
}

fn not_ready<B: Board>(talk: &mut Conversation<B>, axis: u8, why: Option<FaultCode>) {
    assert_eq!(talk.arm(), Status::Refused(Refusal::DriverNotReady { axis, why }));
}

/// The drivers get their settings before anything may move, and the motors their currents.
fn settings_are_written_and_used<B: Board>() {
    let mut talk = with_chips::<B>();
    assert_eq!(chip(&talk, 1).microsteps(), 32, "by the pins that set its address");
    assert_eq!(set(&mut talk, SettingItem::RunCurrent, 0, 1_200), Status::Accepted);
    use_chips(&mut talk);
    not_ready(&mut talk, 0, None);
    talk.wait(SETTING_US);
    talk.arm_and_home();
    let [low, high] = [1_200.0, 800.0];
    for (axis, wanted) in [(0, low), (1, high)] {
        assert_eq!(chip(&talk, axis).microsteps(), MICROSTEPS);
        // The separation was homed last.
        let current = chip(&talk, axis).current_ma(110);
        let expected = if axis == 1 { wanted } else { 400.0 };
        assert!((current - expected).abs() < 0.04 * wanted, "{axis}: {current} mA");
    }
    talk.wait(700_000);
    let rest = chip(&talk, 1).current_ma(110);
    assert!((rest - 400.0).abs() < 20.0, "{rest} mA at rest");
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.faults.len()), (MovePhase::Settled, 0));
    assert!((talk.loads()[0] - 145_000.0).abs() < 20.0, "the microsteps are those that the scale counts");
    at_full_speed_a_short_circuit_is_named_before_a_stall(talk);
}

fn at_full_speed_a_short_circuit_is_named_before_a_stall<B: Board>(mut talk: Conversation<B>) {
    assert_eq!(talk.move_to(NARROW, 2), Status::Accepted);
    talk.wait(450_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    with_chip(&mut talk, 0, |chip| chip.fail(DriverFaults { is_shorted: true, ..DriverFaults::default() }));
    is_cut_by(&mut talk, 0, FaultCode::DriverShort);
}

/// Settings that these drivers cannot have.
fn bad_settings_are_refused<B: Board>() {
    let mut talk = with_chips::<B>();
    let bad = [
        (SettingItem::RunCurrent, 1_900),     // More than sense resistors of 110 mOhm measure.
        (SettingItem::RunCurrent, 100),       // Coarse microsteps.
        (SettingItem::RunCurrent, 0),         // No motor.
        (SettingItem::RunCurrent, 1 << 40),   // No number of the firmware's.
        (SettingItem::HoldCurrent, 900),      // More at rest than in motion.
        (SettingItem::HoldCurrent, 10),       // Less than the driver's finest step.
        (SettingItem::SenseResistor, 0),      // No measurement.
        (SettingItem::SenseResistor, 500),    // The run current would be beyond the range.
        (SettingItem::HoldDelay, 10_000_000), // Longer than the driver counts.
        (SettingItem::Microsteps, 0),         // No motor.
        (SettingItem::Microsteps, 12),        // No power of two.
        (SettingItem::Microsteps, 512),       // More than the driver makes.
        (SettingItem::StealthChop, 2),        // Neither yes nor no.
        (SettingItem::Driver, 2),             // No such driver.
    ];
    for (item, value) in bad {
        let refused = set(&mut talk, item, 0, value);
        assert_eq!(refused, Status::Refused(Refusal::BadSetting), "{} = {value}", item.name());
    }
    assert_eq!(set(&mut talk, SettingItem::SenseResistor, 0, 75), Status::Accepted);
    assert_eq!(set(&mut talk, SettingItem::RunCurrent, 0, 1_900), Status::Accepted, "smaller resistors allow more");
}

/// A hot driver warns and goes on; one that has switched off stops everything until it has cooled.
fn an_overheated_driver_is_a_fault<B: Board>() {
    let mut talk = under_way::<B>();
    with_chip(&mut talk, 1, |chip| chip.heat(130.0));
    talk.wait(50_000);
    assert_eq!((state(&mut talk, 1), talk.pose().state), (DriverState::Hot, ControllerState::Moving));
    with_chip(&mut talk, 1, |chip| chip.heat(145.0));
    is_cut_by(&mut talk, 1, FaultCode::DriverOverheated);
    talk.wait(AGAIN_US);
    assert_eq!(talk.clear(), Status::Accepted);
    not_ready(&mut talk, 1, Some(FaultCode::DriverOverheated));
    with_chip(&mut talk, 1, |chip| chip.heat(60.0));
    talk.wait(AGAIN_US);
    assert_eq!(talk.arm(), Status::Accepted);
}

/// A short circuit switches the driver off by itself; the fault names it before the stage is found to stand.
fn a_short_circuit_is_a_fault<B: Board>() {
    for axis in 0..2 {
        let mut talk = under_way::<B>();
        let shorted = DriverFaults { is_shorted: true, ..DriverFaults::default() };
        with_chip(&mut talk, axis, |chip| chip.fail(shorted));
        is_cut_by(&mut talk, axis as u8, FaultCode::DriverShort);
        assert_eq!(talk.faults.len(), 1);
        // The driver cannot tell while it is off: arming shows it again.
        talk.wait(AGAIN_US);
        assert_eq!((talk.clear(), talk.arm()), (Status::Accepted, Status::Accepted));
        is_cut_by(&mut talk, axis as u8, FaultCode::DriverShort);
        with_chip(&mut talk, axis, |chip| chip.fail(DriverFaults::default()));
        talk.wait(AGAIN_US);
        assert_eq!(talk.clear(), Status::Accepted);
        assert_eq!(talk.arm(), Status::Accepted);
    }
}

/// A wire that breaks, and a driver that was never there.
fn a_silent_driver_is_a_fault<B: Board>() {
    let mut talk = armed::<B>();
    let mute = DriverFaults { is_mute: true, ..DriverFaults::default() };
    with_chip(&mut talk, 0, |chip| chip.fail(mute));
    is_cut_by(&mut talk, 0, FaultCode::DriverSilent);
    talk.wait(AGAIN_US);
    assert_eq!(talk.clear(), Status::Accepted);
    not_ready(&mut talk, 0, Some(FaultCode::DriverSilent));

    let mut talk = Conversation::<B>::open(&Standing::default());
    assert_eq!(set(&mut talk, SettingItem::Driver, 1, 1), Status::Accepted);
    talk.wait(SETTING_US);
    not_ready(&mut talk, 1, Some(FaultCode::DriverSilent));
    // A setting that was a mistake is taken back.
    assert_eq!(set(&mut talk, SettingItem::Driver, 1, 0), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
}

/// A brown-out of the motor supply resets the driver: its microsteps and currents are others from then on.
fn a_driver_that_was_reset_is_a_fault<B: Board>() {
    let mut talk = armed::<B>();
    with_chip(&mut talk, 1, |chip| {
        chip.supply(false);
        chip.supply(true);
        assert_eq!(chip.microsteps(), 32);
    });
    is_cut_by(&mut talk, 1, FaultCode::DriverReset);
    talk.wait(AGAIN_US);
    assert_eq!(chip(&talk, 1).microsteps(), MICROSTEPS, "it got its settings again");
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
}

/// The emergency stop cuts the motor supply, and with it the drivers' memory.
fn after_an_emergency_stop_drivers_get_their_settings_again<B: Board>() {
    let mut talk = armed::<B>();
    talk.board.with_plant(|plant| plant.press_emergency_stop(true));
    talk.wait_for(ControllerState::Fault);
    assert_eq!(talk.fault().code, FaultCode::EmergencyStop);
    talk.wait(AGAIN_US);
    assert_eq!(state(&mut talk, 0), DriverState::Failed(FaultCode::DriverSilent));
    talk.board.with_plant(|plant| plant.press_emergency_stop(false));
    talk.wait(AGAIN_US);
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(chip(&talk, 1).microsteps(), MICROSTEPS);
}

/// Single wrong bits are asked for again; a line that garbles everything is a fault, as is a write that does not arrive.
fn garbled_datagrams_are_noticed<B: Board>() {
    let mut talk = armed::<B>();
    for _ in 0..5 {
        with_chip(&mut talk, 0, |chip| chip.fail(DriverFaults { garbled_replies: 2, ..DriverFaults::default() }));
        talk.wait(100_000);
    }
    assert_eq!(talk.pose().state, ControllerState::Ready);
    with_chip(&mut talk, 0, |chip| chip.fail(DriverFaults { garbled_replies: u32::MAX, ..DriverFaults::default() }));
    is_cut_by(&mut talk, 0, FaultCode::DriverGarbled);

    let mut talk = with_chips::<B>();
    with_chip(&mut talk, 1, |chip| chip.fail(DriverFaults { garbled_writes: 1, ..DriverFaults::default() }));
    use_chips(&mut talk);
    talk.wait(60_000);
    not_ready(&mut talk, 1, Some(FaultCode::DriverUnset));
    talk.wait(AGAIN_US);
    assert_eq!(talk.arm(), Status::Accepted, "the second time all writes arrived");
}

/// Settings that change in the driver, by whatever cause.
fn a_driver_with_other_settings_is_a_fault<B: Board>() {
    let mut talk = armed::<B>();
    with_chip(&mut talk, 0, Tmc2209::flip_microsteps);
    is_cut_by(&mut talk, 0, FaultCode::DriverUnset);
}

stories!(
    settings_are_written_and_used,
    bad_settings_are_refused,
    an_overheated_driver_is_a_fault,
    a_short_circuit_is_a_fault,
    a_silent_driver_is_a_fault,
    a_driver_that_was_reset_is_a_fault,
    after_an_emergency_stop_drivers_get_their_settings_again,
    garbled_datagrams_are_noticed,
    a_driver_with_other_settings_is_a_fault,
);

/// Saved settings reach drivers that have lost theirs with the power, before anything may move.
#[test]
fn saved_settings_reach_the_drivers_at_the_start() {
    let mut talk = set_up::<ElfBoard>();
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    for axis in 0..2 {
        with_chip(&mut talk, axis, |chip| chip.supply(false));
        with_chip(&mut talk, axis, |chip| chip.supply(true));
    }
    let lost = talk.lost;
    talk.board.machine.power_on();
    talk.wait_until("the restart goes unnoticed", |talk| talk.lost > lost);
    talk.reconnect(7);
    talk.wait(SETTING_US);
    assert_eq!([0, 1].map(|axis| state(&mut talk, axis)), [DriverState::Ready; 2]);
    assert_eq!([0, 1].map(|axis| chip(&talk, axis).microsteps()), [MICROSTEPS; 2]);
    assert_eq!(talk.arm(), Status::Accepted);
}

/// With plain drivers, as delivered, the line is never used.
#[test]
fn a_plain_rig_says_nothing_on_the_line() {
    let mut talk = Conversation::<ElfBoard>::open(&Standing::default());
    assert_eq!(talk.arm(), Status::Accepted);
    talk.wait(100_000);
    assert_eq!(talk.board.machine.chip_mut().take_sent(UartId::UART4), []);
    assert_eq!(state(&mut talk, 0), DriverState::Plain);
}
