//! Each difference between the native board and the firmware that `hil-sim/FIDELITY.md` lists, shown by itself on both.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::indexing_slicing,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing};
use vergence_plant::{EncoderFault, NativeBoard, Plant};
use vergence_protocol::management::{Management, ManagementReport};
use vergence_protocol::{
    ControllerState, Happening, HostSession, Microseconds, Report, Request, SessionId, SettingItem, SettingKey, Status,
};

/// Far enough for a second at full speed, in micro-units.
const FAR: [i32; 2] = [145_000, 40_000];

fn opened<B: Board>() -> Conversation<B> {
    Conversation::open(&Standing::default())
}

/// At full speed.
fn under_way<B: Board>() -> Conversation<B> {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    assert_eq!(talk.move_to(FAR, 1), Status::Accepted);
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

/// Milliseconds from power-on until a host hears the board.
fn start_ms<B: Board>() -> u64 {
    let mut talk = Conversation::<B>::off(&Standing::default());
    while !talk.host.is_open() {
        assert!(talk.now.0 < 1_000_000, "it never answers");
        if talk.now.0.is_multiple_of(10_000) {
            talk.host = HostSession::new(SessionId(3));
            talk.host.hello();
        }
        talk.wait(1_000);
    }
    talk.now.0 / 1_000
}

#[test]
fn the_firmware_answers_a_tenth_of_a_second_after_power_on() {
    let [native, chip] = [start_ms::<NativeBoard>(), start_ms::<ElfBoard>()];
    println!("answers after {native} and {chip} ms");
    assert!(native <= 3 && (50..300).contains(&chip), "{native} {chip}");
}

/// How far the board's clock is behind the time since power-on at two poses half a second apart, in microseconds, and the time
/// of the recorded start.
fn clock<B: Board>() -> ([i64; 2], Microseconds) {
    let mut talk = opened::<B>();
    let behind = [0, 1].map(|_| {
        talk.wait(500_000);
        talk.now.0 as i64 - talk.pose().at.0 as i64
    });
    let Report::Events { events, .. } = talk.answer(Request::GetEvents { first: 0 }) else { panic!("no events") };
    let started = events.events.iter().find(|event| event.what == Happening::Started).expect("it has started");
    (behind, started.at)
}

#[test]
fn the_clock_of_the_firmware_is_behind_by_the_time_of_its_start_and_stays_so() {
    let ((native, started), (chip, chip_started)) = (clock::<NativeBoard>(), clock::<ElfBoard>());
    println!("behind by {native:?} and {chip:?} us");
    // A pose is sent every 5 ms, and takes a millisecond.
    let [early, late] = chip;
    assert!(native.iter().all(|&us| us < 7_000) && early > 20_000 && (late - early).abs() < 7_000);
    assert_eq!([started, chip_started], [Microseconds(0); 2]);
}

/// Microseconds from the first byte of a question to the last one of its answer.
fn round_trip_us<B: Board>() -> u64 {
    let mut talk = opened::<B>();
    talk.alive = false;
    talk.wait(20_000);
    let asked = talk.host.send_now(Request::GetInfo).expect("there is room");
    let mut frame = [0; vergence_protocol::MAX_FRAME];
    let length = talk.host.transmit(talk.now, &mut frame).expect("it is sent");
    talk.board.receive(&frame[..length]);
    let from = talk.now.0;
    loop {
        let bytes = talk.board.transmit();
        let mut came = false;
        talk.host.receive(talk.now, &bytes, |event| {
            came |= matches!(event, vergence_protocol::HostEvent::Reply { ticket, .. } if ticket == asked);
        });
        if came {
            return talk.now.0 - from;
        }
        talk.now.0 += 10;
        assert!(talk.now.0 < from + 100_000, "no answer");
        talk.board.advance(talk.now);
    }
}

#[test]
fn bytes_take_their_time_on_the_wire_of_the_firmware_alone() {
    let [native, chip] = [round_trip_us::<NativeBoard>(), round_trip_us::<ElfBoard>()];
    println!("a question and its answer take {native} and {chip} us");
    // 12 and 45 bytes of 10.85 us, the silence after the question, a pose that is being sent.
    assert!(native == 0 && (500..2_500).contains(&chip), "{native} {chip}");
}

/// Poses that were replaced by newer ones while the board answered questions.
fn poses_replaced<B: Board>() -> u32 {
    let mut talk = opened::<B>();
    assert_eq!(talk.ask(Request::SetStream { period_us: 1_000 }), Status::Accepted);
    for _ in 0..50 {
        // More than the 92 bytes that the wire takes in a millisecond.
        for _ in 0..3 {
            talk.host.send_now(Request::GetInfo).expect("there is room");
        }
        talk.wait(1_000);
    }
    talk.wait(50_000);
    match talk.answer(Request::GetStatistics) {
        Report::Statistics { statistics, .. } => statistics.poses_replaced,
        other => panic!("{other:?}"),
    }
}

#[test]
fn poses_that_wait_for_the_wire_of_the_firmware_are_replaced() {
    let [native, chip] = [poses_replaced::<NativeBoard>(), poses_replaced::<ElfBoard>()];
    println!("{native} and {chip} poses replaced");
    assert!(native == 0 && chip > 0, "{native} {chip}");
}

/// The longest time from a pose to the next one around a saving of settings, in milliseconds.
fn pause_ms<B: Board>() -> u64 {
    let mut talk = opened::<B>();
    assert_eq!(talk.ask(Request::SetStream { period_us: 1_000 }), Status::Accepted);
    // The first saving finds an erased page.
    for _ in 0..3 {
        assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    }
    talk.host.submit(talk.now, Request::SaveSettings).expect("there is room");
    let mut times = vec![talk.pose().at.0];
    for _ in 0..200 {
        talk.wait(1_000);
        times.push(talk.pose().at.0);
    }
    times.windows(2).map(|pair| pair[1] - pair[0]).max().expect("there are poses") / 1_000
}

#[test]
fn writing_flash_stops_the_firmware_for_some_tens_of_milliseconds() {
    let [native, chip] = [pause_ms::<NativeBoard>(), pause_ms::<ElfBoard>()];
    println!("no pose for {native} and {chip} ms");
    assert!(native <= 2 && (10..100).contains(&chip), "{native} {chip}");
}

/// The longest time between two pulses at full speed in which one tick comes 150 us late, less the usual time, in microseconds.
fn shift_us<B: Board>(delay: impl Fn(&mut B)) -> f64 {
    let mut talk = under_way::<B>();
    talk.board.with_plant(Plant::record_steps);
    talk.wait(5_000);
    delay(&mut talk.board);
    talk.wait(10_000);
    let mut made = Vec::new();
    talk.board.with_plant(|plant| made = plant.axis_mut(0).expect("it is there").take_steps());
    let mut apart: Vec<f64> = made.windows(2).map(|pair| (pair[1].at_ns - pair[0].at_ns) as f64 * 1e-3).collect();
    apart.sort_by(f64::total_cmp);
    apart[apart.len() - 1] - apart[apart.len() / 2]
}

#[test]
fn a_late_tick_shifts_its_steps_on_the_firmware_alone() {
    const LATE_US: u64 = 150;
    let native = shift_us::<NativeBoard>(|board| board.delay_tick(LATE_US));
    let chip = shift_us::<ElfBoard>(|board| board.delay_tick(LATE_US));
    println!("steps are {native:.1} and {chip:.1} us late");
    // The list waits 20 us for its tick.
    assert!(native < 1.0 && (LATE_US as f64 - 25.0..LATE_US as f64 + 10.0).contains(&chip), "{native} {chip}");
}

/// The phase of the first pulse of a jog to that of the ticks, in microseconds: `ticks` is a time at which one began.
fn first_pulse_us<B: Board>(tick: impl Fn(&mut Conversation<B>) -> u64) -> f64 {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    talk.board.with_plant(Plant::record_steps);
    let began = tick(&mut talk);
    assert_eq!(talk.jog([20_000, 0]), Status::Accepted);
    talk.wait(200_000);
    let mut made = Vec::new();
    talk.board.with_plant(|plant| made = plant.axis_mut(0).expect("it is there").take_steps());
    ((made[0].at_ns - began * 1_000) % 1_000_000) as f64 * 1e-3
}

#[test]
fn steps_of_the_firmware_are_made_20_us_late() {
    let native = first_pulse_us::<NativeBoard>(|_| 0);
    let chip = first_pulse_us::<ElfBoard>(|talk| {
        let passed = talk.board.tick_passed_us();
        talk.now.0 - talk.board_start - passed
    });
    println!("the first pulse comes {native:.1} and {chip:.1} us after its tick");
    // From rest, the first step depends on the jerk alone.
    assert!((chip - native - 20.0).abs() < 3.0, "{native} {chip}");
}

/// Counts of a stage at rest whose encoder is noisy, pose by pose.
fn noise<B: Board>() -> Vec<i32> {
    let mut talk = opened::<B>();
    let fault = EncoderFault::Noisy { amplitude: 20, seed: 1 };
    talk.board.with_plant(|plant| plant.axis_mut(0).expect("it is there").fail_encoder(Some(fault)));
    let counts = (0..40).map(|_| {
        talk.wait(5_000);
        talk.pose().counts[0].0
    });
    counts.collect()
}

#[test]
fn noise_of_an_encoder_of_the_same_seed_is_another_on_each_board() {
    let [native, chip] = [noise::<NativeBoard>(), noise::<ElfBoard>()];
    assert!([&native, &chip].iter().all(|counts| counts.iter().any(|&count| count != counts[0])));
    assert_ne!(native, chip);
}

/// How many counts a stage has gone while its encoder stood, and how many of them are shown some time after it works again.
fn jump<B: Board>(shown: impl Fn(&mut B) -> i32) -> [i32; 2] {
    let mut talk = under_way::<B>();
    let fail = |talk: &mut Conversation<B>, fault| {
        talk.board.with_plant(|plant| plant.axis_mut(0).expect("it is there").fail_encoder(fault));
    };
    fail(&mut talk, Some(EncoderFault::Stuck));
    talk.wait(300_000);
    let stood = shown(&mut talk.board);
    fail(&mut talk, None);
    // Less than a microsecond for each ten counts.
    talk.now.0 += 100;
    talk.board.advance(Microseconds(talk.now.0 - talk.board_start));
    let soon = shown(&mut talk.board) - stood;
    talk.wait(20_000);
    [soon, shown(&mut talk.board) - stood]
}

#[test]
fn an_encoder_that_works_again_counts_to_its_place_on_the_firmware_and_jumps_on_the_native_board() {
    let native = jump::<NativeBoard>(|board| vergence_control::RigIo::encoder(board.plant(), 0));
    let chip = jump::<ElfBoard>(|board| board.machine.chip().world().counts_on_lines()[0]);
    println!("{native:?} and {chip:?} counts");
    assert!(native[0] == native[1] && native[0].abs() > 600, "{native:?}");
    // An edge takes 0.2 us.
    assert!(chip[0].abs() <= 500 && chip[1].abs() > 600, "{chip:?}");
}

/// Whether a host that stays at the old speed of the line goes on to hear the board.
fn old_speed_is_heard<B: Board>() -> bool {
    let mut talk = opened::<B>();
    let key = SettingKey { item: SettingItem::Baud, axis: 0 };
    assert_eq!(talk.ask(Request::SetSetting { key, value: 115_200 }), Status::Accepted);
    talk.wait(20_000);
    let before = talk.pose().at;
    // Less than the trial of a speed lasts.
    talk.wait(100_000);
    talk.pose().at.0 > before.0 + 50_000
}

#[test]
fn the_line_of_the_firmware_alone_has_a_speed() {
    assert!(old_speed_is_heard::<NativeBoard>() && !old_speed_is_heard::<ElfBoard>());
}

/// What names the board: its kind, and the hardware that an image must name.
fn names<B: Board>() -> (String, u32) {
    let mut talk = opened::<B>();
    let board = talk.info().board.to_string();
    talk.host.manage(Management::Identify).expect("there is room");
    talk.wait_until("no answer", |talk| !talk.management.is_empty());
    match talk.management[0] {
        ManagementReport::Identity(identity) => (board, identity.hardware),
        ref other => panic!("{other:?}"),
    }
}

#[test]
fn the_boards_have_names_and_hardware_of_their_own() {
    let [native, chip] = [names::<NativeBoard>(), names::<ElfBoard>()];
    assert!(native.0 == "native-sim" && chip.0 == "nucleo-g474" && native.1 != chip.1, "{native:?} {chip:?}");
}

/// What a board logs by itself at its start.
fn log<B: Board>() -> Vec<u8> {
    let mut talk = opened::<B>();
    talk.wait(200_000);
    talk.log
}

#[test]
fn the_firmware_alone_logs_by_itself() {
    assert!(log::<NativeBoard>().is_empty() && !log::<ElfBoard>().is_empty());
}
