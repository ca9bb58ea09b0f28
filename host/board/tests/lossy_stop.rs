//! Stops over a line that loses one byte in a thousand: how long the stages go on at most.
//!
//! `VERGENCE_STOPS=20000` makes that many.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::indexing_slicing,
    reason = "a test fails loudly and shows its figures"
)]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_board::RepeatedStop;
use vergence_control::TICK_US;
use vergence_plant::{NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::{
    AxisMask, ControllerState, HostEvent, HostSession, MAX_FRAME, Micro, Microseconds, Mode, Move, MoveId, Permille,
    Request, SessionId, StopKind, Ticket,
};

const STOPS: u32 = 4_000;
const BYTE_ERRORS: f64 = 1e-3;
/// Nanoseconds of a byte at 921 600 baud.
const BYTE_NS: u64 = 10_851;
/// How often the host looks at the line, in microseconds.
const STEP_US: u64 = 250;
const BEAT_US: u64 = 20_000;
const POSE_PERIOD_US: u32 = 5_000;

/// One direction of the line: frames that arrive one after the other, each byte wrong or lost with the same probability.
struct Line {
    random: Pcg64Mcg,
    errors: f64,
    free_at_ns: u64,
    frames: Vec<(u64, Vec<u8>)>,
}

impl Line {
    fn new(seed: u64) -> Self {
        Self { random: Pcg64Mcg::seed_from_u64(seed), errors: BYTE_ERRORS, free_at_ns: 0, frames: Vec::new() }
    }

    fn send(&mut self, now: Microseconds, frame: &[u8]) {
        self.free_at_ns = self.free_at_ns.max(now.0 * 1_000) + frame.len() as u64 * BYTE_NS;
        let bytes = frame.iter().filter_map(|&byte| match self.random.random::<f64>() / self.errors {
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
struct Talk {
    board: NativeBoard,
    host: HostSession,
    lines: [Line; 2],
    now: Microseconds,
    next_beat: u64,
    stop: Option<RepeatedStop>,
    replies: Vec<Ticket>,
    /// Time at which the board first was in the state [`ControllerState::Stopping`] since the last stop was ordered.
    stopping_at: Option<u64>,
}

impl Talk {
    fn open() -> Self {
        let board = NativeBoard::standing_at(&bench_settings(), &bench_mechanics(), &[63_000.0, 40_000.0], 1);
        let mut talk = Self {
            board: board.expect("the bench works"),
            host: HostSession::new(SessionId(7)),
            lines: [Line::new(1), Line::new(2)],
            now: Microseconds(0),
            next_beat: 0,
            stop: None,
            replies: Vec::new(),
            stopping_at: None,
        };
        talk.wait(100_000);
        talk.host.hello();
        talk.wait_until(|talk| talk.host.is_open());
        talk.ask(Request::SetStream { period_us: POSE_PERIOD_US });
        talk.ask(Request::Arm { session: SessionId(7) });
        talk.ask(Request::Home { axes: AxisMask::first(2) });
        talk.wait_until(|talk| talk.board.state() == ControllerState::Ready);
        talk
    }

    fn step(&mut self) {
        self.now.0 += STEP_US;
        for (at, bytes) in self.lines[0].arrived(self.now) {
            self.board.advance(Microseconds(at));
            self.board.receive(&bytes);
            if self.board.state() == ControllerState::Stopping {
                self.stopping_at.get_or_insert(at);
            }
        }
        self.board.advance(self.now);
        let sent = self.board.transmit();
        self.lines[1].send(self.now, &sent);
        for (_, bytes) in self.lines[1].arrived(self.now) {
            let replies = &mut self.replies;
            self.host.receive(self.now, &bytes, |event| {
                if let HostEvent::Reply { ticket, .. } = event {
                    replies.push(ticket);
                }
            });
        }
        self.stop.take_if(|stop| self.replies.iter().any(|&ticket| stop.is_answered_by(ticket)));
        if let Some(stop) = &mut self.stop {
            stop.send(self.now, &mut self.host).expect("a stop is always taken");
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
        panic!("it never came: {:?}", self.board.state());
    }

    fn ask(&mut self, request: Request) {
        let ticket = self.host.submit(self.now, request).expect("there is room");
        self.wait_until(|talk| talk.replies.contains(&ticket));
        self.replies.clear();
    }
}

#[test]
fn a_stop_comes_through_a_line_that_loses_bytes() {
    let stops = std::env::var("VERGENCE_STOPS").ok().and_then(|text| text.parse().ok()).unwrap_or(STOPS);
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut talk = Talk::open();
    let (mut braking, mut answers) = (Vec::new(), Vec::new());
    for number in 0..stops {
        let targets = if number % 2 == 0 { [215_000, 2_000_000] } else { [65_000, 10_000] };
        let order = Move {
            id: MoveId((number % 60_000) as u16 + 1),
            mode: Mode(1),
            targets: targets.into_iter().map(Micro).collect(),
            speed: Permille::FULL,
        };
        talk.ask(Request::MoveTo(order));
        talk.wait(random.random_range(30_000..130_000));
        assert_eq!(talk.board.state(), ControllerState::Moving);
        let asked = talk.now.0;
        talk.stopping_at = None;
        talk.stop = Some(RepeatedStop::new(StopKind::Decelerate, talk.now));
        talk.wait_until(|talk| talk.stop.is_none());
        answers.push(talk.now.0 - asked);
        let heard = talk.stopping_at.expect("it was answered");
        // Steps are ordered a tick ahead: those of the tick after the next are the first that brake.
        braking.push((heard / TICK_US + 2) * TICK_US - asked);
        talk.wait_until(|talk| talk.board.state() == ControllerState::Ready);
    }
    braking.sort_unstable();
    answers.sort_unstable();
    let late = braking.iter().filter(|&&us| us > 5_000).count();
    let [median, worst] = [braking[braking.len() / 2], braking[braking.len() - 1]].map(|us| us as f64 / 1_000.0);
    println!("{stops} stops, one byte in {:.0} wrong or lost each way", 1.0 / BYTE_ERRORS);
    println!("first braking step after {median:.1} ms (median), {worst:.1} ms (worst); {late} stops were sent again");
    println!("answer after at most {:.1} ms", answers[answers.len() - 1] as f64 / 1_000.0);
    // Four in a row are lost once in six million stops.
    assert!(worst < 4.0 * 20.0 + 5.0, "{worst} ms");
}
