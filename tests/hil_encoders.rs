//! Encoders with an index, and absolute encoders: on the native board and on the unmodified firmware, which reads the index line
//! by its interrupt and the absolute encoders over the SPI of the simulated chip.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{BOTH, Board, Conversation, ElfBoard, Standing, Wired, cruise, geared};
use vergence_control::{Scale, TURN};
use vergence_plant::{As5048aChip, EncoderFault, MagnetFault, NativeBoard, bench_mechanics};
use vergence_protocol::{
    AxisKind, AxisMask, ControllerState, EncoderState, FaultCode, MovePhase, Refusal, Report, Request, SettingItem,
    SettingKey, Status, Trigger,
};

/// Counts from one index pulse to the next: 2 mm, 7.2 degrees.
const EVERY: [i32; 2] = [4_000, 2_000];
/// Where moves go: across several pulses, in micro-units.
const AWAY: [i32; 2] = [75_000, 700_000];
const BACK: [i32; 2] = [61_000, 100_000];
/// The separation's magnet turns twice as fast as the separation, and reads so many counts at its zero.
const GEAR: u32 = 2;
const MOUNT: u16 = 5_000;
const HERBIVORE: [i32; 2] = [145_000, 2_094_395];

fn set<B: Wired>(talk: &mut Conversation<B>, item: SettingItem, axis: u8, value: i64) -> Status {
    talk.ask(Request::SetSetting { key: SettingKey { item, axis }, value })
}

fn state<B: Wired>(talk: &mut Conversation<B>, axis: u8) -> EncoderState {
    match talk.answer(Request::GetEncoder { axis }) {
        Report::Encoder { state, .. } => state,
        other => panic!("{other:?}"),
    }
}

/// Passes, drift and largest drift of an axis.
fn drift<B: Wired>(talk: &mut Conversation<B>, axis: u8) -> (u32, i32, i32) {
    match state(talk, axis) {
        EncoderState::Indexed { passes, drift, worst } => (passes, drift, worst),
        other => panic!("{other:?}"),
    }
}

/// Goes there, and says how it ended.
fn go<B: Wired>(talk: &mut Conversation<B>, targets: [i32; 2]) -> MovePhase {
    assert_eq!(talk.move_to(targets, 1), Status::Accepted);
    talk.wait(20_000);
    talk.wait_until("the move does not end", |talk| {
        let pose = talk.pose();
        pose.state == ControllerState::Fault || pose.phase == MovePhase::Settled && pose.state == ControllerState::Ready
    });
    talk.wait(10_000);
    talk.pose().phase
}

/// Homed, with encoders whose index pulses are so wide and are checked.
fn indexed<B: Board>(width: i32) -> Conversation<B> {
    let mut talk = checked::<B>(width);
    talk.arm_and_home();
    talk
}

fn checked<B: Board>(width: i32) -> Conversation<B> {
    let mut mechanics = bench_mechanics();
    for (axis, every) in mechanics.iter_mut().zip(EVERY) {
        axis.index = [every, width];
    }
    let mut talk = Conversation::<B>::open(&Standing { mechanics, ..Standing::default() });
    for (axis, every) in (0..).zip(EVERY) {
        assert_eq!(set(&mut talk, SettingItem::IndexEvery, axis, every.into()), Status::Accepted);
    }
    talk
}

/// Index pulses of any width, passed in both directions at full speed and with counts that flicker, raise no fault.
fn a_healthy_encoder_passes_its_index<B: Board>(rounds: usize) {
    for (width, noise) in [(1, 0), (4, 1), (900, 1)] {
        let mut talk = indexed::<B>(width);
        for axis in 0..2 {
            let fault = (noise > 0).then_some(EncoderFault::Noisy { amplitude: noise, seed: 7 });
            talk.board.with_plant(|plant| plant.axis_mut(axis).expect("it is there").fail_encoder(fault));
        }
        for _ in 0..rounds {
            for targets in [AWAY, BACK] {
                assert_eq!(go(&mut talk, targets), MovePhase::Settled, "{:?}", talk.faults);
            }
        }
        for (axis, least) in [(0u8, 12), (1, 8)] {
            let (passes, now, worst) = drift(&mut talk, axis);
            println!("axis {axis}, pulses of {width}, noise {noise}: {passes} passed, {now:+}, worst {worst:+}");
            assert!(passes >= rounds as u32 * least && worst.abs() <= 4, "{passes} {worst}");
        }
        assert!(talk.faults.is_empty());
    }
}

#[test]
fn the_firmware_passes_the_index_of_a_healthy_encoder() {
    a_healthy_encoder_passes_its_index::<ElfBoard>(2);
}

#[test]
fn the_native_board_passes_the_index_of_a_healthy_encoder() {
    a_healthy_encoder_passes_its_index::<NativeBoard>(10);
}

fn lose<B: Board>(talk: &mut Conversation<B>, axis: usize, counts: i32) {
    talk.board.with_plant(|plant| plant.axis_mut(axis).expect("it is there").lose_counts(counts));
    talk.wait(50_000);
}

/// Counts that are lost within the tolerance are noticed by nothing but the index.
fn lost_counts_are_noticed_at_the_index<B: Board>() {
    for (axis, few, many) in [(0u8, 10, 30), (1, 2, 5)] {
        let mut talk = indexed::<B>(4);
        // Each direction has its first pass.
        for targets in [AWAY, BACK, AWAY] {
            assert_eq!(go(&mut talk, targets), MovePhase::Settled);
        }
        lose(&mut talk, axis.into(), few);
        assert_eq!(go(&mut talk, BACK), MovePhase::Settled, "{:?}", talk.faults);
        let (_, now, worst) = drift(&mut talk, axis);
        println!("axis {axis}, {few} counts lost: drift {now:+}, worst {worst:+}");
        assert!((now + few).abs() <= 2 && worst.abs() >= now.abs());
        lose(&mut talk, axis.into(), many - few);
        assert_eq!(go(&mut talk, AWAY), MovePhase::Stopped);
        let fault = talk.fault();
        assert_eq!((fault.code, fault.axis), (FaultCode::EncoderDrift, Some(axis)));
        assert!((fault.detail + many).abs() <= 2, "{fault:?}");
        assert_eq!(talk.pose().referenced, AxisMask(BOTH.0 & !(1 << axis)), "the other axis knows where it is");
        assert!(talk.board.plant().drivers_on(), "it is held");
        // It brakes first.
        talk.wait(300_000);
        assert_eq!(talk.clear(), Status::Accepted);
        talk.wait(50_000);
        talk.arm_and_home();
        assert_eq!(go(&mut talk, AWAY), MovePhase::Settled);
    }
}

#[test]
fn the_firmware_notices_lost_counts_at_the_index() {
    lost_counts_are_noticed_at_the_index::<ElfBoard>();
}

#[test]
fn the_native_board_notices_lost_counts_at_the_index() {
    lost_counts_are_noticed_at_the_index::<NativeBoard>();
}

/// What the index is for: without it the same loss goes unnoticed.
#[test]
fn without_an_index_a_loss_within_the_tolerance_goes_unnoticed() {
    let mut talk = Conversation::<NativeBoard>::homed(&Standing::default());
    assert_eq!(go(&mut talk, AWAY), MovePhase::Settled);
    lose(&mut talk, 0, 24);
    assert_eq!(go(&mut talk, BACK), MovePhase::Settled, "{:?}", talk.faults);
    assert_eq!(state(&mut talk, 0), EncoderState::Plain);
    let off = f64::from(talk.pose().counts[0].0) * 0.5 - talk.loads()[0];
    assert!(off < -9.0, "{off} um");
}

fn a_broken_index_wire_is_noticed<B: Board>() {
    let mut talk = checked::<B>(0);
    assert_eq!(talk.arm(), Status::Accepted);
    // The way from the switch into the range is as long as that between two pulses.
    assert_eq!(talk.home(), Status::Accepted);
    talk.wait(20_000);
    talk.wait_until("no fault", |talk| talk.pose().state != ControllerState::Homing);
    if talk.pose().state == ControllerState::Ready {
        go(&mut talk, AWAY);
    }
    assert_eq!(talk.fault().code, FaultCode::IndexMissing);
    assert!(talk.board.plant().drivers_on() && talk.pose().referenced != BOTH);
}

#[test]
fn the_firmware_notices_a_broken_index_wire() {
    a_broken_index_wire_is_noticed::<ElfBoard>();
}

#[test]
fn the_native_board_notices_a_broken_index_wire() {
    a_broken_index_wire_is_noticed::<NativeBoard>();
}

/// An index that comes too often for the ticks, or nowhere in the range, is refused.
#[test]
fn an_index_that_cannot_be_checked_is_refused() {
    let mut talk = Conversation::<ElfBoard>::open(&Standing::default());
    for counts in [-1, 100, 400_000] {
        assert_eq!(set(&mut talk, SettingItem::IndexEvery, 0, counts), Status::Refused(Refusal::BadSetting));
    }
}

/// The separation has an AS5048A behind a gear, and the board its settings.
fn absolute<B: Board>() -> Conversation<B> {
    let mut talk = Conversation::<B>::off(&Standing::default());
    talk.board.with_plant(|plant| {
        let turn = std::f64::consts::TAU * 1e6 / f64::from(GEAR);
        plant.axis_mut(1).expect("it is there").mount(As5048aChip::new(turn, MOUNT));
    });
    talk.connect();
    let counts = i64::from(TURN * GEAR);
    for (item, value) in
        [(SettingItem::CountsPerUnit, counts), (SettingItem::EncoderZero, MOUNT.into()), (SettingItem::Encoder, 1)]
    {
        assert_eq!(set(&mut talk, item, 1, value), Status::Accepted, "{item:?}");
    }
    talk.wait(50_000);
    talk
}

/// How far the encoder of the separation is from the truth, in its counts.
fn off<B: Wired>(talk: &Conversation<B>) -> f64 {
    let encoder = Scale { kind: AxisKind::Rotary, per_unit: TURN * GEAR };
    let count = f64::from(encoder.position_at(1_000_000).0) * 1e-6;
    f64::from(talk.pose().counts[1].0) - talk.loads()[1] / count
}

/// After its power was cut the firmware knows where the separation is, and goes to a mode once the baseline is homed.
#[test]
fn after_power_on_an_absolute_axis_needs_no_homing() {
    let mut talk = absolute::<ElfBoard>();
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    talk.board.machine.set_supply(1_500);
    talk.wait(5_000);
    talk.board.machine.set_supply(3_300);
    talk.reconnect(8);
    talk.wait(50_000);
    assert_eq!((talk.pose().state, talk.pose().referenced), (ControllerState::Idle, AxisMask(0b10)));
    assert!(matches!(state(&mut talk, 1), EncoderState::Absolute { gain: 128, .. }));
    assert!(off(&talk).abs() <= 1.0, "{}", off(&talk));
    assert_eq!(talk.arm(), Status::Accepted);
    let before = talk.loads()[1];
    assert_eq!(talk.ask(Request::Home { axes: AxisMask(0b10) }), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert!((talk.loads()[1] - before).abs() < 1.0, "an absolute axis is homed where it stands");
    assert_eq!(talk.home(), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    assert_eq!(talk.pose().referenced, BOTH);
    for targets in [HERBIVORE, BACK] {
        assert_eq!(go(&mut talk, targets), MovePhase::Settled, "{:?}", talk.faults);
        assert!(off(&talk).abs() <= 1.0, "{}", off(&talk));
        let error = talk.loads()[1] - f64::from(targets[1]);
        assert!(error.abs() < 349.0 + 192.0, "{error} urad: the tolerance and a count");
    }
}

#[test]
fn an_absolute_encoder_that_turns_more_than_once_is_refused() {
    let mut talk = Conversation::<ElfBoard>::open(&Standing::default());
    // 100 000 counts a turn: the separation's 130 degrees are 2.2 turns of the encoder.
    assert_eq!(set(&mut talk, SettingItem::Encoder, 1, 1), Status::Refused(Refusal::BadSetting));
    assert_eq!(set(&mut talk, SettingItem::EncoderZero, 1, TURN.into()), Status::Refused(Refusal::BadSetting));
}

/// What can go wrong with an absolute encoder, and the fault that it must be.
const TROUBLES: [(MagnetFault, FaultCode); 8] = [
    (MagnetFault::Stuck(true), FaultCode::EncoderLost),
    (MagnetFault::Stuck(false), FaultCode::EncoderLost),
    (MagnetFault::FlippedAnswer(3), FaultCode::EncoderGarbled),
    (MagnetFault::FlippedQuestion(3), FaultCode::EncoderGarbled),
    (MagnetFault::Weak, FaultCode::EncoderMagnet),
    (MagnetFault::Strong, FaultCode::EncoderMagnet),
    (MagnetFault::Gone, FaultCode::EncoderMagnet),
    (MagnetFault::Starting, FaultCode::EncoderLost),
];

fn fail<B: Board>(talk: &mut Conversation<B>, fault: Option<MagnetFault>) {
    talk.board.with_plant(|plant| {
        plant.axis_mut(1).and_then(|axis| axis.magnet_mut()).expect("an encoder").fail(fault);
    });
}

/// Each trouble in mid-move cuts the drivers; the axis cannot be armed until it is over, and then knows again where it is.
fn troubles_of_an_absolute_encoder_end_safely<B: Board>() {
    let mut talk = absolute::<B>();
    for (trouble, code) in TROUBLES {
        talk.arm_and_home();
        let far = if talk.loads()[1] < 1e6 { 1_500_000 } else { 200_000 };
        assert_eq!(talk.move_to([80_000, far], 1), Status::Accepted);
        talk.wait(400_000);
        assert_eq!(talk.pose().state, ControllerState::Moving, "{trouble:?}: {:?}", talk.faults);
        fail(&mut talk, Some(trouble));
        talk.wait(8_000);
        assert!(!talk.board.plant().drivers_on(), "{trouble:?}");
        talk.wait_for(ControllerState::Fault);
        assert_eq!((talk.fault().code, talk.fault().axis), (code, Some(1)), "{trouble:?}");
        assert_eq!(talk.pose().referenced, AxisMask(0));
        assert_eq!(talk.clear(), Status::Accepted);
        talk.wait(100_000);
        assert_eq!(talk.arm(), Status::Refused(Refusal::EncoderNotReady { axis: 1, why: Some(code) }), "{trouble:?}");
        assert_eq!(state(&mut talk, 1), EncoderState::Failed(code));
        fail(&mut talk, None);
        talk.wait(200_000);
        assert_eq!(talk.pose().referenced, AxisMask(0b10), "{trouble:?}");
        assert!(off(&talk).abs() <= 1.0);
    }
}

#[test]
fn on_the_firmware_troubles_of_an_absolute_encoder_end_safely() {
    troubles_of_an_absolute_encoder_end_safely::<ElfBoard>();
}

#[test]
fn on_the_native_board_troubles_of_an_absolute_encoder_end_safely() {
    troubles_of_an_absolute_encoder_end_safely::<NativeBoard>();
}

/// One garbled answer, as by a spark, stops nothing.
#[test]
fn one_garbled_answer_is_read_over() {
    let mut talk = absolute::<ElfBoard>();
    talk.arm_and_home();
    assert_eq!(talk.move_to([80_000, 1_500_000], 1), Status::Accepted);
    talk.wait(400_000);
    fail(&mut talk, Some(MagnetFault::FlippedAnswer(3)));
    talk.wait(1_000);
    fail(&mut talk, None);
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.faults.len()), (MovePhase::Settled, 0));
}

/// A trigger's mark names the angle at its edge, though the encoder is read in the ticks beside it.
#[test]
fn a_trigger_mark_tells_the_angle_at_its_edge() {
    let mut talk = absolute::<ElfBoard>();
    talk.arm_and_home();
    assert_eq!(talk.ask(Request::SetTrigger(Trigger::Every { period_us: 7_300 })), Status::Accepted);
    assert_eq!(talk.move_to([80_000, 1_900_000], 1), Status::Accepted);
    talk.wait(500_000);
    let mut errors = Vec::new();
    for _ in 0..20 {
        let marks = talk.marks.len();
        talk.wait_until("no pulse", |talk| talk.marks.len() > marks);
        let (_, loads) = talk.board.plant().exposed().expect("it was fired");
        let truth = loads[1] / 191.748;
        errors.push(f64::from(talk.marks.last().expect("a mark").counts[1].0) - truth);
    }
    println!("errors of marks in motion, in counts: {errors:.2?}");
    assert_eq!(talk.pose().state, ControllerState::Moving);
    assert!(errors.iter().all(|error| error.abs() < 2.0), "{errors:?}");
}

/// Both encoders on one bus, both axes at 100 kHz: the time of the longest tick.
#[test]
fn two_absolute_encoders_leave_the_tick_below_half_of_its_period() {
    const TIM7: u16 = 16 + 55;
    let mut talk = geared();
    // A turn of the baseline's encoder is 182 mm.
    let turns = [16_384.0 / 0.09, std::f64::consts::TAU * 1e6 / f64::from(GEAR)];
    let counts = [90_000, i64::from(TURN * GEAR)];
    for (axis, (turn, counts)) in turns.into_iter().zip(counts).enumerate() {
        talk.board.with_plant(|plant| plant.axis_mut(axis).expect("it is there").mount(As5048aChip::new(turn, MOUNT)));
        for (item, value) in
            [(SettingItem::CountsPerUnit, counts), (SettingItem::EncoderZero, MOUNT.into()), (SettingItem::Encoder, 1)]
        {
            assert_eq!(set(&mut talk, item, axis as u8, value), Status::Accepted, "{item:?}");
        }
    }
    talk.wait(50_000);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.pose().referenced, BOTH);
    cruise(&mut talk);
    talk.board.machine.time_handlers();
    talk.wait(300_000);
    assert_eq!((talk.pose().state, talk.faults.len()), (ControllerState::Moving, 0), "{:?}", talk.faults);
    let tick = talk.board.machine.cpu().handler_time(TIM7);
    println!("worst tick with two absolute encoders: {} us", tick.longest_span / 170);
    assert!(tick.longest_span < 85_000, "{tick:?}");
}
