//! Time on the firmware at full load: the board's clock as the host estimates it, the instants and counts of poses and of
//! trigger pulses. The truth is that of the simulation. Both axes make 100 000 steps a second, poses come at 1 kHz, pulses
//! at 100 Hz, and the host asks without a pause.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Adapter, AdapterKind, Conversation, ElfBoard, LEASE_MS, Wired, cruise, far_from, geared};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{Bench, Machine, Picoseconds};
use vergence_protocol::{
    AxisList, ControllerState, Counts, HostEvent, HostSession, MAX_FRAME, Microseconds, Mode, Move, MoveId, Permille,
    PoseReport, Report, Request, Status, Trigger, TriggerMark,
};
use vergence_rig::{ClockMap, Exchange};

const BAUD: u32 = 921_600;
/// TIM15_CNT, which counts the board's microseconds modulo 2^16.
const TIM15_CNT: u32 = 0x4001_4024;
const TIM15_WRAP: u64 = 1 << 16;
/// How often the host looks at the wire, in true microseconds.
const STEP_US: u64 = 20;
const BEAT_US: u64 = 20_000;
/// The periods at which the link of `vergence` probes the clock, and how often at the first.
const PROBE_US: [u64; 2] = [98_390, 983_900];
const FAST_PROBES: u32 = 10;
const TRIGGER_US: u32 = 10_000;
/// What the time in a mark may be off: whole microseconds, and the way into the interrupt where interrupts are locked.
const TRIGGER_BOUND_US: f64 = 3.0;
/// Numbers of the moves here, so that none is one of those before.
const FIRST_MOVE: u16 = 1_000;
/// Seconds with each adapter, unless `VERGENCE_CLOCK_SECONDS` says more.
const WATCHED_S: u64 = 2;

const ADAPTERS: [AdapterKind; 4] = [
    AdapterKind { latency_us: [0, 0], jitter_us: 0, bundle_us: 1, host_ppm: 50.0 },
    AdapterKind { latency_us: [125, 125], jitter_us: 300, bundle_us: 125, host_ppm: -50.0 },
    AdapterKind { latency_us: [900, 100], jitter_us: 2_000, bundle_us: 1_000, host_ppm: 50.0 },
    AdapterKind { latency_us: [100, 3_000], jitter_us: 5_000, bundle_us: 16_000, host_ppm: -50.0 },
];

/// The true time at which the board's clock read zero, in microseconds to a tenth. `latest` is a recent reading of it.
fn board_start(machine: &mut Machine<Bench>, latest: Microseconds) -> f64 {
    let mut count = || {
        machine.run_for(Picoseconds::nanoseconds(50));
        let cycle = machine.cpu().now();
        let read = machine.chip_mut().read(cycle, TIM15_CNT, Access::Word).expect("the timer is there");
        (u64::from(read), machine.time().0 as f64 / 1e6)
    };
    let (before, _) = count();
    let (reads, us) = std::iter::repeat_with(count).find(|(now, _)| *now != before).expect("it counts");
    let passed = (reads + TIM15_WRAP - latest.0 % TIM15_WRAP) % TIM15_WRAP;
    us - (latest.0 + passed) as f64
}

fn on_lines(machine: &Machine<Bench>) -> [i32; 2] {
    machine.chip().world().counts_on_lines().try_into().expect("two axes")
}

/// The largest error, and the error and what was stated for it where their ratio is largest.
#[derive(Clone, Copy, Default, Debug)]
struct Worst {
    error: f64,
    tightest: [f64; 2],
    share: f64,
}

impl Worst {
    fn note(&mut self, error: f64, stated: f64) {
        let error = error.abs();
        self.error = self.error.max(error);
        if error / stated > self.share {
            (self.share, self.tightest) = (error / stated, [error, stated]);
        }
    }
}

/// A host behind an adapter, and a board in motion.
struct Watch {
    board: ElfBoard,
    host: HostSession,
    adapter: Adapter,
    map: ClockMap,
    /// True time.
    us: u64,
    /// See [`board_start`].
    start: f64,
    /// What the lines of each encoder showed where the axis has its zero.
    zero: [i32; 2],
    /// The board's time and what the lines showed, at each look and at each pulse.
    lines: Vec<(f64, [i32; 2])>,
    fired: Vec<(f64, [i32; 2])>,
    poses: Vec<PoseReport>,
    marks: Vec<TriggerMark>,
    next_beat: u64,
    next_probe: u64,
    probes: u32,
    moves: u16,
    questions: u64,
    offset: Worst,
    drift: Worst,
}

impl Watch {
    fn new() -> Self {
        let mut talk = geared();
        talk.arm_and_home();
        talk.wait(10_000);
        let shown = on_lines(&talk.board.machine);
        let counts = &talk.pose().counts;
        let zero = [0, 1].map(|axis| shown[axis] - counts[axis].0);
        assert_eq!(talk.ask(Request::SetTrigger(Trigger::Every { period_us: TRIGGER_US })), Status::Accepted);
        cruise(&mut talk);
        let latest = talk.pose().at;
        let start = board_start(&mut talk.board.machine, latest);
        let Conversation { board, host, now, .. } = talk;
        Self {
            board,
            host,
            adapter: Adapter::new(ADAPTERS[0], now.0, now),
            map: ClockMap::default(),
            us: now.0,
            start,
            zero,
            lines: Vec::new(),
            fired: Vec::new(),
            poses: Vec::new(),
            marks: Vec::new(),
            next_beat: 0,
            next_probe: 0,
            probes: 0,
            moves: FIRST_MOVE,
            questions: 0,
            offset: Worst::default(),
            drift: Worst::default(),
        }
    }

    fn now(&self) -> Microseconds {
        Microseconds(self.adapter.host_clock(self.us) as u64)
    }

    /// The board's clock at a true time, in microseconds.
    fn board_clock(&self, us: f64) -> f64 {
        us - self.start
    }

    /// Puts another adapter between host and board, which forgets what the first one told about the clock.
    fn plug(&mut self, kind: AdapterKind) {
        self.adapter.become_kind(kind, self.us);
        self.map = ClockMap::at_baud(BAUD);
        (self.next_probe, self.probes) = (0, 0);
        (self.offset, self.drift) = (Worst::default(), Worst::default());
    }

    fn run(&mut self, us: u64) {
        let end = self.us + us;
        while self.us < end {
            self.us += STEP_US;
            self.board.advance(Microseconds(self.us));
            self.look();
            let mut frames = Vec::new();
            self.speak(&mut frames);
            let said = self.board.transmit();
            let [to_board, to_host] = self.adapter.pass(self.us, &frames, &said);
            self.board.receive(&to_board);
            self.hear(&to_host);
        }
    }

    fn look(&mut self) {
        let us = self.board.machine.time().0 as f64 / 1e6;
        self.lines.push((self.board_clock(us), on_lines(&self.board.machine)));
        let fired = self.board.machine.chip().world().fired().cloned();
        if let Some(fired) = fired {
            let at = self.board_clock(fired.at.time.0 as f64 / 1e6);
            if self.fired.last().is_none_or(|(last, _)| *last < at) {
                self.fired.push((at, fired.counts.try_into().expect("two axes")));
            }
        }
    }

    /// Queues what is due, and never lets the board wait for a question.
    fn speak(&mut self, into: &mut Vec<u8>) {
        let now = self.now();
        if now.0 >= self.next_beat {
            let beat = Request::Heartbeat { session: self.host.id(), lease_ms: LEASE_MS };
            self.host.send_now(beat).expect("the line takes it");
            self.next_beat = now.0 + BEAT_US;
        }
        if now.0 >= self.next_probe {
            let period = PROBE_US[usize::from(self.probes >= FAST_PROBES)];
            self.probes += 1;
            self.next_probe = now.0 + period;
            self.host.send_now(Request::TimeProbe { t0: now }).expect("the line takes it");
            self.map.probe_sent();
        }
        if self.host.unanswered() == 0 {
            self.questions += 1;
            let question = self.question();
            self.host.submit(now, question).expect("the session takes it");
        }
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(now, &mut frame) {
            into.extend_from_slice(&frame[..length]);
        }
    }

    /// The next move where the board has come to rest, else a question.
    fn question(&mut self) -> Request {
        if self.poses.last().is_some_and(|pose| pose.state == ControllerState::Ready) {
            self.moves += 1;
            let loads = self.board.plant().loads().try_into().expect("two axes");
            let targets = far_from(loads).into_iter().map(vergence_protocol::Micro).collect();
            return Request::MoveTo(Move { id: MoveId(self.moves), mode: Mode(1), targets, speed: Permille::FULL });
        }
        Request::GetStatistics
    }

    fn hear(&mut self, bytes: &[u8]) {
        let now = self.now();
        let mut events = Vec::new();
        self.host.receive(now, bytes, |event| events.push(event));
        for event in events {
            match event {
                HostEvent::Report(Report::TimeReply { t0, t1, t2 }) => {
                    self.map.observe(Exchange { t0, t1, t2, t3: now });
                }
                HostEvent::Report(Report::Pose(pose)) => {
                    self.poses.push(pose);
                    self.judge_clock();
                }
                HostEvent::Report(Report::TriggerMark(mark)) => self.marks.push(mark),
                HostEvent::Reply { report: Report::Ack { status, .. }, .. } => assert_eq!(status, Status::Accepted),
                HostEvent::Report(Report::Fault(fault)) => panic!("{fault:?}"),
                _ => {}
            }
        }
    }

    /// Compares the present estimate with the truth, with each pose.
    fn judge_clock(&mut self) {
        let host = self.adapter.host_clock(self.us);
        let Some(estimate) = self.map.board_at(Microseconds(host as u64)) else { return };
        let truth = self.board_clock(self.us as f64);
        // The estimate is for a whole microsecond of the host.
        self.offset.note(estimate.us + host.fract() - truth, estimate.error_us);
        let drift = self.map.drift().expect("there is an estimate");
        self.drift.note(drift.ppm - self.adapter.board_ppm(), drift.error_ppm);
    }

    /// What the lines showed at a time of the board's clock, in counts from the axis zero; `None` where it is not known.
    fn shown_at(&self, at: f64) -> Option<[f64; 2]> {
        let after = self.lines.partition_point(|(time, _)| *time < at);
        let ((t0, c0), (t1, c1)) = (self.lines.get(after.checked_sub(1)?)?, self.lines.get(after)?);
        let share = (at - t0) / (t1 - t0);
        Some([0, 1].map(|axis| {
            let [c0, c1] = [c0, c1].map(|counts| f64::from(counts[axis] - self.zero[axis]));
            c0 + share * (c1 - c0)
        }))
    }
}

/// The largest difference of any axis, in counts.
fn farthest(counts: &AxisList<Counts>, truth: [f64; 2]) -> f64 {
    [0, 1].map(|axis| (f64::from(counts[axis].0) - truth[axis]).abs()).into_iter().fold(0.0, f64::max)
}

fn seconds() -> u64 {
    std::env::var("VERGENCE_CLOCK_SECONDS").map_or(WATCHED_S, |text| text.parse().expect("whole seconds"))
}

/// Lets the host estimate the clock through each adapter; what is stated must hold at each pose.
fn judge_adapters(watch: &mut Watch) {
    println!(
        "to the board, from it, jitter, bundles (us), host (ppm): worst error of the offset; tightest, and its bound (us)"
    );
    for kind in ADAPTERS {
        watch.plug(kind);
        watch.run(seconds() * 1_000_000);
        let AdapterKind { latency_us: [to, from], jitter_us, bundle_us, host_ppm } = kind;
        let (Worst { error, tightest, share }, drift) =
            (watch.offset, watch.map.drift().expect("there is an estimate"));
        println!(
            "{to} {from} {jitter_us} {bundle_us} {host_ppm}: {error:.0}; {tightest:.0?}; drift {:.1} +- {:.1} ppm, {} probes",
            drift.ppm, drift.error_ppm, watch.probes,
        );
        assert!(share <= 1.0 && watch.drift.share <= 1.0, "{:?} {:?}", watch.offset, watch.drift);
    }
}

/// Each pose tells where the axes were when it says.
fn judge_poses(watch: &Watch) {
    let known = watch.poses.iter().filter_map(|pose| Some(farthest(&pose.counts, watch.shown_at(pose.at.0 as f64)?)));
    let off: Vec<f64> = known.collect();
    let worst = off.iter().copied().fold(0.0, f64::max);
    println!("{} poses: at most {worst:.1} counts off", off.len());
    // A count of the encoder, and what moves on in a microsecond and between two looks at the lines.
    assert!(off.len() as u64 > seconds() * 3_000 && worst < 1.5, "{worst}");
}

/// Each pulse is reported, with its time and the counts of its edge.
fn judge_marks(watch: &Watch) {
    let mut worst = [0.0_f64; 2];
    // The mark of the last pulse may still be under way, and that of the first one was before.
    let fired = &watch.fired[1..watch.fired.len() - 3];
    for (at, counts) in fired {
        let is_of = |mark: &&TriggerMark| (mark.at.0 as f64 - at).abs() < 1_000.0;
        let mark = watch.marks.iter().find(is_of).unwrap_or_else(|| panic!("no mark of the pulse at {at}"));
        let truth = [0, 1].map(|axis| f64::from(counts[axis] - watch.zero[axis]));
        worst[0] = worst[0].max(farthest(&mark.counts, truth));
        worst[1] = worst[1].max((mark.at.0 as f64 - at).abs());
    }
    println!("{} pulses: at most {} counts and {:.1} us off", fired.len(), worst[0], worst[1]);
    assert!(fired.len() as u64 > seconds() * 300 && worst[0] <= 1.0 && worst[1] <= TRIGGER_BOUND_US, "{worst:?}");
}

#[test]
fn clock_poses_and_pulses_are_as_true_as_stated_at_full_load() {
    let mut watch = Watch::new();
    judge_adapters(&mut watch);
    println!("{} questions answered, {} moves", watch.questions, watch.moves - FIRST_MOVE);
    assert!(u64::from(watch.moves - FIRST_MOVE) > seconds(), "the axes stand");
    judge_poses(&watch);
    judge_marks(&watch);
}
