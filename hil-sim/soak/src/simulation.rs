//! Runs host, line, board and mechanics in virtual time.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vergence_control::SettingsError;
use vergence_plant::{NativeBoard, Plant};
use vergence_protocol::{Microseconds, ResetCause};

use crate::checker::Checker;
use crate::faults::Fault;
use crate::host::{Host, HostEnd};
use crate::injector::{Injector, World};
use crate::journal::Journal;
use crate::line::{Line, LineFaults};
use crate::promise::{Promise, Violation};
use crate::scenario::Scenario;
use crate::stages::stages;

/// Period of the host and of the checks.
const TURN_US: u64 = 1_000;
/// Longest duration of a scenario.
const LONGEST_US: u64 = 180_000_000;
/// How long the board is checked after the host has fallen silent: its lease, the longest braking, and a margin.
const TAIL_US: u64 = 800_000;
/// The host's clock at the start, so that it stays positive when it jumps back.
const HOST_START_US: u64 = 10_000_000;

/// Operations that a scenario needs from a board.
pub trait Board {
    /// Lets time pass until `to` on the board's clock.
    fn advance(&mut self, to: Microseconds);
    /// Takes bytes that arrive now.
    fn receive(&mut self, bytes: &[u8]);
    /// Takes all frames that leave now, one after the other.
    fn transmit(&mut self) -> Vec<u8>;
    /// Delays the next control tick by so many microseconds.
    fn delay_tick(&mut self, us: u64);
    /// Restarts the board in any state; the clock by which it is advanced reads `now` then.
    fn restart(&mut self, boot: u32, now: Microseconds);
    /// The simulated mechanics, which know the true positions.
    fn plant(&self) -> &Plant;
    /// Changes the mechanics.
    fn with_plant(&mut self, act: &mut dyn FnMut(&mut Plant));
    /// Longest time from bytes that arrive to what they cause, and from a change to the pose that reports it, in
    /// microseconds.
    fn delay_us(&self) -> u64 {
        0
    }
    /// The reason why the board works no more; `None` while it works.
    fn halted(&self) -> Option<String> {
        None
    }
}

impl Board for NativeBoard {
    fn advance(&mut self, to: Microseconds) {
        self.advance(to);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.receive(bytes);
    }

    fn transmit(&mut self) -> Vec<u8> {
        self.transmit()
    }

    fn delay_tick(&mut self, us: u64) {
        self.delay_tick(us);
    }

    fn restart(&mut self, boot: u32, _now: Microseconds) {
        // The settings were accepted at the first start.
        let _ = self.restart(ResetCause::Watchdog, boot);
    }

    fn plant(&self) -> &Plant {
        self.plant()
    }

    fn with_plant(&mut self, act: &mut dyn FnMut(&mut Plant)) {
        act(self.plant_mut());
    }
}

/// The real controller as the board of a scenario, without planted faults.
///
/// # Errors
/// [`SettingsError`] where the stages cannot be controlled.
pub fn native_board(scenario: &Scenario) -> Result<NativeBoard, SettingsError> {
    let settings = stages().map(|stage| stage.settings);
    let mechanics = stages().map(|stage| stage.mechanics);
    NativeBoard::standing_at(&settings, &mechanics, &scenario.positions, boot_number(scenario.seed))
}

fn boot_number(seed: u64) -> u32 {
    seed as u32
}

/// Ending of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The host has completed its script.
    Completed,
    /// The host gave up and everything is at rest.
    SafeStop,
}

/// The outcome of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How the scenario ended; without meaning where promises were broken.
    pub ending: Ending,
    /// Broken promises, each once.
    pub violations: Vec<Violation>,
    /// Duration in virtual time.
    pub virtual_time: Microseconds,
    /// The events.
    pub journal: Journal,
}

impl Outcome {
    /// Ending, broken promises and all events for programs; `scenario` is what was run.
    #[must_use]
    pub fn json(&self, scenario: &Scenario) -> Value {
        let events = self.journal.events().iter().map(|(at, what)| json!({ "us": at.0, "what": what }));
        let violations = self.violations.iter().map(|broken| json!({ "us": broken.at.0, "what": broken.to_string() }));
        json!({
            "seed": scenario.seed,
            "fault": scenario.kind.name(),
            "ending": format!("{:?}", self.ending),
            "violations": violations.collect::<Vec<_>>(),
            "log": events.collect::<Vec<_>>(),
        })
    }
}

/// Runs `scenario` with `board`, just switched on.
pub fn run(scenario: &Scenario, board: &mut impl Board) -> Outcome {
    Simulation::new(scenario, board).play()
}

struct Simulation<'a, B> {
    board: &'a mut B,
    board_start: u64,
    boot: u32,
    host: Host,
    host_offset: i64,
    to_host: Line,
    to_board: Line,
    injector: Injector,
    checker: Checker,
    journal: Journal,
    now: Microseconds,
    phase_us: u64,
    step_since: Microseconds,
    bytes: Vec<u8>,
}

impl<'a, B: Board> Simulation<'a, B> {
    fn new(scenario: &Scenario, board: &'a mut B) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(scenario.seed ^ 0x11e5);
        let faults = line_faults(&scenario.faults);
        let mut line = || Line::new(faults, scenario.latency_us, Pcg64Mcg::seed_from_u64(random.random()));
        let mut journal = Journal::default();
        let now = Microseconds(scenario.phase_us);
        journal.note(now, format!("seed {}, {}: {:?}", scenario.seed, scenario.kind, scenario.faults));
        Self {
            checker: Checker::new(stages(), &scenario.faults, board.plant(), board.delay_us()),
            board,
            board_start: 0,
            boot: boot_number(scenario.seed),
            host: Host::new(scenario.script.clone(), scenario.probe_us, Microseconds(now.0 + HOST_START_US)),
            host_offset: HOST_START_US as i64,
            to_host: line(),
            to_board: line(),
            injector: Injector::new(scenario),
            journal,
            now,
            phase_us: scenario.phase_us,
            step_since: now,
            bytes: Vec::new(),
        }
    }

    fn play(mut self) -> Outcome {
        let mut silent_since = None;
        while silent_since.is_none_or(|since: u64| self.now.0 < since + TAIL_US) {
            self.turn();
            if let Some(halt) = self.board.halted() {
                self.checker.accuse(self.now, Promise::Ends, format!("the board works no more: {halt}"));
                break;
            }
            if self.host.end().is_some() {
                silent_since = silent_since.or(Some(self.now.0));
            }
            if self.now.0 > LONGEST_US {
                self.checker.accuse(self.now, Promise::Ends, "the scenario does not end".into());
                break;
            }
        }
        self.finish()
    }

    fn turn(&mut self) {
        self.now.0 += TURN_US;
        let now = self.now;
        self.board.advance(Microseconds(now.0 - self.board_start));
        self.checker.watch(now, self.board.plant());
        let frames = self.board.transmit();
        // Every frame ends with its only zero byte.
        for frame in frames.split_inclusive(|&byte| byte == 0) {
            self.checker.received_from_board(now, frame, self.board.plant(), &mut self.journal);
            self.to_host.send(now, frame);
        }
        self.run_host();
        self.bytes.clear();
        self.to_board.deliver(now, &mut self.bytes);
        if !self.bytes.is_empty() {
            self.checker.received_from_host(now, &self.bytes);
            self.board.receive(&self.bytes);
            self.checker.received(now, self.board.plant());
        }
        self.inject();
    }

    fn run_host(&mut self) {
        let host_now = Microseconds(self.now.0.saturating_add_signed(self.host_offset));
        self.bytes.clear();
        self.to_host.deliver(self.now, &mut self.bytes);
        self.host.receive(host_now, &self.bytes);
        let step = self.host.step();
        let (now, line) = (self.now, &mut self.to_board);
        self.host.turn(host_now, |frame| line.send(now, frame));
        for note in self.host.notes.drain(..) {
            self.journal.note(now, note);
        }
        if self.host.step() != step {
            self.step_since = now;
        }
    }

    fn inject(&mut self) {
        let (mut late_us, mut restarts) = (0, false);
        self.board.with_plant(&mut |plant| {
            let mut world = World {
                now: self.now,
                step: self.host.step(),
                in_step_us: self.now.0 - self.step_since.0,
                plant,
                late_us: &mut late_us,
                lines: [&mut self.to_host, &mut self.to_board],
                host_offset: &mut self.host_offset,
                checker: &mut self.checker,
                journal: &mut self.journal,
            };
            restarts = self.injector.inject(&mut world);
        });
        if late_us > 0 {
            self.board.delay_tick(late_us);
        }
        if restarts {
            self.boot = self.boot.wrapping_add(1);
            self.board.restart(self.boot, Microseconds(self.phase_us));
            self.board_start = self.now.0 - self.phase_us;
            // Not yet one turn of its clock has passed.
            self.checker.restarted(self.board.plant());
        }
    }

    fn finish(mut self) -> Outcome {
        let now = self.now;
        let ending = match self.host.end() {
            Some(HostEnd::Done) => Ending::Completed,
            Some(HostEnd::Unanswered) => {
                self.checker.accuse(now, Promise::Ends, "a request was never answered".into());
                Ending::SafeStop
            }
            Some(HostEnd::ForbiddenAccepted) => {
                self.checker.accuse(now, Promise::Refuses, "a request that must be refused was accepted".into());
                Ending::SafeStop
            }
            Some(HostEnd::GaveUp) | None => Ending::SafeStop,
        };
        self.checker.check_rest(now);
        let violations = self.checker.into_violations();
        for violation in &violations {
            self.journal.note(violation.at, format!("VIOLATION: {violation}"));
        }
        if violations.is_empty() {
            self.journal.note(now, format!("{ending:?}"));
        }
        Outcome { ending, violations, virtual_time: now, journal: self.journal }
    }
}

fn line_faults(faults: &[Fault]) -> LineFaults {
    let mut line = LineFaults::default();
    for fault in faults {
        match *fault {
            Fault::ByteErrors(rate) => line.byte_errors = rate,
            Fault::Drops(rate) => line.drops = rate,
            Fault::Duplicates(rate) => line.duplicates = rate,
            _ => {}
        }
    }
    line
}
