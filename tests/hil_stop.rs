//! Stops over a line that loses one byte in a thousand: how long the stages go on at most, by the pulses that the motors get, on the
//! native board and on the firmware on the simulated chip.
//!
//! `VERGENCE_STOPS=10000` makes that many on the native board, `VERGENCE_ELF_STOPS=300` on the firmware.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::indexing_slicing,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, ElfBoard, Standing};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_board::RepeatedStop;
use vergence_plant::{NativeBoard, StepMade, bench_settings};
use vergence_protocol::{
    AxisMask, ControllerState, HostEvent, HostSession, MAX_FRAME, Micro, Microseconds, Mode, Move, MoveId, Permille,
    PoseReport, Report, Request, SessionId, StopKind, Ticket,
};

/// Stops in the normal run, on the native board and on the firmware.
const STOPS: [u32; 2] = [400, 12];
const BYTE_ERRORS: f64 = 1e-3;
/// Nanoseconds of a byte at 921 600 baud on the way to and from the native board; the chip's ports take their own time.
const BYTE_NS: u64 = 10_851;
/// How often the host looks at the line, in microseconds.
const STEP_US: u64 = 250;
const BEAT_US: u64 = 20_000;
const POSE_PERIOD_US: u32 = 5_000;
/// Time from the order of a move to its constant speed, in microseconds: 8 ticks of planning and 250 ms.
const CRUISES_US: u64 = 265_000;
/// Length of the stretch at constant speed from which the motor's place is foretold, in nanoseconds.
const STRETCH_NS: u64 = 60_000_000;
/// Steps by which a motor is behind that place where its braking is judged.
const BEHIND: [f64; 2] = [6.0, 14.0];

/// One direction of the line: frames that arrive one after the other, each byte wrong or lost with the same probability.
struct Line {
    random: Pcg64Mcg,
    byte_ns: u64,
    free_at_ns: u64,
    frames: Vec<(u64, Vec<u8>)>,
}

impl Line {
    fn new(seed: u64, byte_ns: u64) -> Self {
        Self { random: Pcg64Mcg::seed_from_u64(seed), byte_ns, free_at_ns: 0, frames: Vec::new() }
    }

    fn send(&mut self, now: Microseconds, frame: &[u8]) {
        self.free_at_ns = self.free_at_ns.max(now.0 * 1_000) + frame.len() as u64 * self.byte_ns;
        let bytes = frame.iter().filter_map(|&byte| match self.random.random::<f64>() / BYTE_ERRORS {
            hit if hit < 0.5 => None,
            hit if hit < 1.0 => Some(byte ^ 1 << self.random.random_range(0..8)),
            _ => Some(byte),
        });
        let bytes = bytes.collect();
        self.frames.push((self.free_at_ns.div_ceil(1_000), bytes));
    }

    /// The frames that have arrived, each with its time.
    fn arrived(&mut self, now: Microseconds) -> Vec<(u64, Vec<u8>)> {
        let count = self.frames.partition_point(|(at, _)| *at <= now.0);
        self.frames.drain(..count).collect()
    }
}

/// Host, line and board in virtual time.
struct Talk<B> {
    board: B,
    host: HostSession,
    lines: [Line; 2],
    now: Microseconds,
    next_beat: u64,
    stop: Option<RepeatedStop>,
    sendings: usize,
    replies: Vec<Ticket>,
    pose: Option<PoseReport>,
}

impl<B: Board> Talk<B> {
    fn open(byte_ns: u64) -> Self {
        let mut talk = Self {
            board: B::switched_on(&Standing::default()),
            host: HostSession::new(SessionId(7)),
            lines: [Line::new(1, byte_ns), Line::new(2, byte_ns)],
            now: Microseconds(0),
            next_beat: 0,
            stop: None,
            sendings: 0,
            replies: Vec::new(),
            pose: None,
        };
        talk.wait(500_000);
        talk.host.hello();
        talk.wait_until(|talk| talk.host.is_open());
        talk.ask(Request::SetStream { period_us: POSE_PERIOD_US });
        talk.ask(Request::Arm { session: SessionId(7) });
        talk.ask(Request::Home { axes: AxisMask::first(2) });
        talk.wait_for(ControllerState::Ready);
        talk.board.with_plant(vergence_plant::Plant::record_steps);
        talk
    }

    fn step(&mut self) {
        self.now.0 += STEP_US;
        for (at, bytes) in self.lines[0].arrived(self.now) {
            // What left in the last step is on the chip's own wire.
            self.board.advance(Microseconds(at));
            self.board.receive(&bytes);
        }
        self.board.advance(self.now);
        let sent = self.board.transmit();
        self.lines[1].send(self.now, &sent);
        for (_, bytes) in self.lines[1].arrived(self.now) {
            let (replies, pose) = (&mut self.replies, &mut self.pose);
            self.host.receive(self.now, &bytes, |event| match event {
                HostEvent::Reply { ticket, .. } => replies.push(ticket),
                HostEvent::Report(Report::Pose(seen)) => *pose = Some(seen),
                _ => {}
            });
        }
        self.stop.take_if(|stop| self.replies.iter().any(|&ticket| stop.is_answered_by(ticket)));
        if let Some(stop) = &mut self.stop {
            stop.send(self.now, &mut self.host).expect("a stop is always taken");
            self.sendings = stop.sendings();
        }
        if self.host.is_open() && self.now.0 >= self.next_beat {
            self.next_beat = self.now.0 + BEAT_US;
            let beat = Request::Heartbeat { session: self.host.id(), lease_ms: 100 };
            self.host.send_now(beat).expect("the line takes it");
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(self.now, &mut frame) {
            self.lines[0].send(self.now, &frame[..length]);
        }
    }

    fn wait(&mut self, us: u64) {
        (0..us / STEP_US).for_each(|_| self.step());
    }

    /// Waits for something, 20 s at most.
    fn wait_until(&mut self, come: impl Fn(&Self) -> bool) {
        for _ in 0..20_000_000 / STEP_US {
            if come(self) {
                return;
            }
            self.step();
        }
        panic!("it never came: {:?}", self.pose);
    }

    /// Waits for a pose in this state that was not on its way yet.
    fn wait_for(&mut self, state: ControllerState) {
        self.wait(10_000);
        self.pose = None;
        self.wait_until(|talk| talk.pose.as_ref().is_some_and(|pose| pose.state == state));
    }

    fn ask(&mut self, request: Request) {
        let ticket = self.host.submit(self.now, request).expect("there is room");
        self.wait_until(|talk| talk.replies.contains(&ticket));
        self.replies.clear();
    }

    /// A move of the baseline to the further end of its range, at full speed; the separation goes along.
    fn go(&mut self, number: u32) {
        let loads = self.board.plant().loads();
        let turns = if number.is_multiple_of(2) { 300_000 } else { 500_000 };
        let targets = [if loads[0] < 140_000.0 { 219_000 } else { 61_000 }, turns];
        self.ask(Request::MoveTo(Move {
            id: MoveId((number % 60_000) as u16 + 1),
            mode: Mode(1),
            targets: targets.into_iter().map(Micro).collect(),
            speed: Permille::FULL,
        }));
    }

    fn pulses(&mut self) -> Vec<StepMade> {
        let mut made = Vec::new();
        self.board.with_plant(|plant| made = plant.axis_mut(0).expect("it is there").take_steps());
        made
    }
}

/// When a motor that goes at constant speed until `ordered_us` begins to brake, in microseconds: it then falls behind by a sixth of
/// the jerk times the cube of the time.
fn braking_begins(pulses: &[StepMade], ordered_us: u64) -> f64 {
    let axis = bench_settings()[0];
    let jerk = f64::from(axis.jerk) / (f64::from(axis.motor().position_at(1_000_000).0) * 1e-6);
    let ordered = pulses.partition_point(|step| step.at_ns < ordered_us * 1_000);
    let from = pulses.partition_point(|step| step.at_ns + STRETCH_NS < ordered_us * 1_000);
    let [first, last] = [from, ordered - 1].map(|index| pulses[index].at_ns as f64);
    let period = (last - first) / (ordered - 1 - from) as f64;
    let begins = pulses.iter().enumerate().skip(ordered).filter_map(|(number, step)| {
        let behind = (step.at_ns as f64 - last) / period - (number + 1 - ordered) as f64;
        let since = (6.0 * behind / jerk).cbrt();
        (BEHIND[0]..BEHIND[1]).contains(&behind).then_some(step.at_ns as f64 * 1e-3 - since * 1e6)
    });
    let begins: Vec<f64> = begins.collect();
    assert!(begins.len() > 10, "the motor brakes: {}", begins.len());
    begins.iter().sum::<f64>() / begins.len() as f64
}

/// Makes so many stops, and shows how long the first braking steps took, in milliseconds; returns median and worst.
fn stops<B: Board>(name: &str, count: u32, byte_ns: u64) -> [f64; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut talk = Talk::<B>::open(byte_ns);
    let (mut braking, mut answers, mut again) = (Vec::new(), Vec::new(), 0);
    for number in 0..count {
        talk.go(number);
        talk.wait(CRUISES_US + STRETCH_NS / 1_000 + random.random_range(0..200_000));
        let asked = talk.now.0;
        talk.stop = Some(RepeatedStop::new(StopKind::Decelerate, talk.now));
        talk.wait_until(|talk| talk.stop.is_none());
        answers.push((talk.now.0 - asked) as f64 * 1e-3);
        again += u32::from(talk.sendings > 1);
        talk.wait_for(ControllerState::Ready);
        braking.push((braking_begins(&talk.pulses(), asked) - asked as f64) * 1e-3);
    }
    [&mut braking, &mut answers].into_iter().for_each(|times| times.sort_by(f64::total_cmp));
    let [median, worst] = [braking[braking.len() / 2], braking[braking.len() - 1]];
    println!("{name}: {count} stops, one byte in {:.0} wrong or lost each way", 1.0 / BYTE_ERRORS);
    println!("braking begins after {:.1} to {worst:.1} ms, median {median:.1} ms; {again} were sent again", braking[0]);
    println!("answer after at most {:.1} ms", answers[answers.len() - 1]);
    [median, worst]
}

fn named(name: &str, otherwise: u32) -> u32 {
    std::env::var(name).ok().map_or(otherwise, |text| text.parse().expect("a number of stops"))
}

/// A stop is sent every 20 ms. Four in a row are lost once in six million stops. One that arrives is taken within a tick, and its steps
/// begin two ticks later; the frame takes 0.2 ms, a look of the host and the estimate as much.
const TAKEN_MS: f64 = 4.0;

#[test]
fn a_stop_comes_through_a_line_that_loses_bytes_on_the_native_board() {
    let [median, worst] = stops::<NativeBoard>("native board", named("VERGENCE_STOPS", STOPS[0]), BYTE_NS);
    assert!(median < TAKEN_MS && worst < 3.0 * 20.0 + TAKEN_MS, "{median} {worst}");
}

#[test]
fn a_stop_comes_through_a_line_that_loses_bytes_on_the_firmware() {
    let [median, worst] = stops::<ElfBoard>("firmware", named("VERGENCE_ELF_STOPS", STOPS[1]), 0);
    assert!(median < TAKEN_MS && worst < 3.0 * 20.0 + TAKEN_MS, "{median} {worst}");
}
