//! Plays a session on both boards: one host, whose bytes go to both.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use vergence_plant::NativeBoard;
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{
    AxisMask, ControllerState, MAX_FRAME, Microseconds, PROTOCOL, Request, SessionId, SettingItem, SettingKey,
    StopKind, schema_hash,
};

use super::compare::Comparison;
use super::delivered::NextImage;
use super::difference::{Difference, Verdict};
use super::mishap::Mishap;
use super::pair::{ARRIVALS_US, Pair};
use super::session::{Act, Session};
use super::slack::LAG_LIMITS;
use crate::chip_board::ChipBoard;
use crate::journal::Journal;

/// Ticks from one heartbeat to the next, and the lease in milliseconds.
const BEAT_TICKS: u64 = 20;
const LEASE_MS: u16 = 100;
/// Ticks at rest after which the session goes on.
const REST_TICKS: u64 = 90;
/// Ticks after which the host stops what still moves. The slowest homing of a session takes less, with 0.4 of the speeds that
/// the bench has: 200 mm at 16 mm/s, 160 degrees at 8 degrees a second, and twice a retreat of 3 mm at 2 mm/s and of 2
/// degrees at 2 degrees a second, each approach from twice as far. A setting of a few micro-units a second would take days.
const PATIENCE_TICKS: u64 = 60_000;
/// Sessions are numbered from here.
const FIRST_SESSION: u32 = 0x5e55_0000;
/// Ticks after a fault was mended, so that encoders and switches show it.
const MEND_TICKS: u64 = 100;

/// Plays `session` on the native board and on the chip; both have just got power, with the same mechanics at the same places.
/// An update leads to `next`.
#[must_use]
pub fn play(session: &Session, native: NativeBoard, chip: ChipBoard, next: &NextImage) -> Verdict {
    let mut driver = Driver::new(session, Pair::new(native, chip), next);
    let result = driver.play(session);
    driver.finish(result)
}

pub(super) struct Driver<'a> {
    pub(super) pair: Pair,
    pub(super) comparison: Comparison,
    pub(super) next: &'a NextImage,
    journal: Journal,
    random: Pcg64Mcg,
    session: u32,
    pub(super) open: bool,
    alive: bool,
    beat_in: u64,
    /// Frames that wait for the line.
    pub(super) waiting: VecDeque<[Vec<u8>; 2]>,
    control: u8,
    immediate: u8,
    pub(super) management: u8,
    mishaps: Vec<Mishap>,
    pub(super) boots: u32,
}

impl<'a> Driver<'a> {
    fn new(session: &Session, pair: Pair, next: &'a NextImage) -> Self {
        Self {
            pair,
            comparison: Comparison::new(),
            next,
            journal: Journal::default(),
            random: Pcg64Mcg::seed_from_u64(session.seed ^ 0x0a11),
            session: FIRST_SESSION,
            open: false,
            alive: true,
            beat_in: 0,
            waiting: VecDeque::new(),
            control: 0,
            immediate: 0,
            management: 0,
            mishaps: Vec::new(),
            boots: session.seed as u32,
        }
    }

    fn play(&mut self, session: &Session) -> Result<(), Difference> {
        if !self.pair.start() {
            return Err(Difference::new("start", "runs", self.pair.halted()));
        }
        for act in &session.acts {
            self.note(format!("{act:?}"));
            self.act(act)?;
        }
        // The last answers are still on the wire.
        self.wait(50)?;
        self.comparison.compare_end(&self.pair)
    }

    fn finish(mut self, result: Result<(), Difference>) -> Verdict {
        let virtual_seconds = self.pair.now_us() as f64 * 1e-6;
        if let Err(difference) = &result {
            for (side, name) in self.pair.sides.iter().zip(["native", "chip"]) {
                for (at, what) in &side.heard {
                    self.journal.note(Microseconds(*at), format!("{name}: {what}"));
                }
            }
            for tick in self.pair.ticks.iter().rev().take(3).rev() {
                let text = format!("native tick: {:?}, loads {:.1?}, steps {:?}", tick.pose, tick.loads, tick.steps);
                self.journal.note(Microseconds(self.pair.now_us()), text);
            }
            self.note(format!("DIFFERENCE: {difference}"));
        }
        let figures = self.comparison.figures;
        Verdict { difference: result.err(), figures, journal: self.journal, virtual_seconds }
    }

    fn note(&mut self, what: String) {
        self.journal.note(Microseconds(self.pair.now_us()), what);
    }

    pub(super) fn act(&mut self, act: &Act) -> Result<(), Difference> {
        match act {
            Act::Open(period_us) => self.connect(*period_us),
            Act::Ask(request, pause) => {
                self.ask(request);
                self.wait((*pause).into())
            }
            Act::AskNow(request) => {
                self.ask_now(request);
                self.wait(2)
            }
            Act::Arm => {
                self.ask(&Request::Arm { session: SessionId(self.session) });
                self.wait(20)
            }
            Act::Wait(ticks) => self.wait((*ticks).into()),
            Act::Rest => self.rest(),
            Act::Silence(ticks) => {
                self.alive = false;
                self.wait((*ticks).into())?;
                (self.alive, self.beat_in) = (true, 0);
                Ok(())
            }
            Act::Mishap(mishap) => {
                self.comparison.apart.failing = true;
                self.mishaps.push(*mishap);
                self.pair.with_plants(|plant| mishap.begin(plant));
                Ok(())
            }
            Act::LateTick(us) => self.delay(*us),
            Act::Reset => self.reset(),
            Act::Update(image) => self.refused_update(image),
            Act::Install(fate) => self.install(*fate),
            Act::Recover => self.recover(),
            Act::ReadEvents => {
                for first in (0..64).step_by(4) {
                    self.ask(&Request::GetEvents { first });
                    self.wait(4)?;
                }
                Ok(())
            }
        }
    }

    /// Runs both boards for so many ticks; sends what waits, at most one frame in each tick.
    pub(super) fn wait(&mut self, ticks: u64) -> Result<(), Difference> {
        for _ in 0..ticks {
            if self.open && self.alive {
                self.beat_in = match self.beat_in.checked_sub(1) {
                    Some(left) => left,
                    None => {
                        let session = SessionId(self.session);
                        self.ask_now(&Request::Heartbeat { session, lease_ms: LEASE_MS });
                        BEAT_TICKS
                    }
                };
            }
            if let Some(frames) = self.waiting.pop_front() {
                let phase = self.random.random_range(ARRIVALS_US[0]..ARRIVALS_US[1]);
                self.pair.send(frames, phase);
            }
            self.pair.turn();
            if let Some(halt) = self.pair.halted() {
                return Err(Difference::new("work", "goes on", halt));
            }
            self.comparison.compare(&mut self.pair)?;
        }
        Ok(())
    }

    /// Queues a message for both boards.
    fn queue(&mut self, kind: Kind, seq: u8, request: &Request) {
        let frame = framed(kind, seq, request);
        self.waiting.push_back([frame.clone(), frame]);
    }

    pub(super) fn ask(&mut self, request: &Request) {
        if let Request::SetSetting { key: SettingKey { item: SettingItem::FollowingError, axis }, value } = request {
            let limit = LAG_LIMITS.get(usize::from(*axis)).copied().unwrap_or_default();
            self.comparison.apart.at_the_lag |= (1..=limit).contains(value);
        }
        self.queue(Kind::Control, self.control, request);
        self.control = self.control.wrapping_add(1);
    }

    fn ask_now(&mut self, request: &Request) {
        let mut request = request.clone();
        if let Request::TimeProbe { t0 } = &mut request {
            *t0 = Microseconds(self.pair.now_us());
        }
        self.queue(Kind::Immediate, self.immediate, &request);
        self.immediate = self.immediate.wrapping_add(1);
    }

    pub(super) fn connect(&mut self, period_us: u32) -> Result<(), Difference> {
        self.session += 1;
        let session = SessionId(self.session);
        self.ask_now(&Request::Hello { protocol: PROTOCOL, schema: schema_hash(), session });
        (self.control, self.open, self.beat_in) = (0, true, 0);
        self.wait(20)?;
        self.ask(&Request::SetStream { period_us });
        self.wait(20)
    }

    fn is_moving(&self) -> bool {
        let state = self.pair.native().state();
        let moves = matches!(state, ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping);
        let steps = |back: usize| self.pair.ticks.iter().rev().nth(back).map(|tick| tick.steps.clone());
        moves || steps(0) != steps(1)
    }

    /// Waits until nothing has moved for a while; stops what moves for very long.
    fn rest(&mut self) -> Result<(), Difference> {
        let (mut still, mut waited) = (0, 0);
        while still < REST_TICKS {
            self.wait(1)?;
            still = if self.is_moving() { 0 } else { still + 1 };
            waited += 1;
            if waited == PATIENCE_TICKS {
                self.ask_now(&Request::Stop { kind: StopKind::Decelerate });
            }
            if waited > 2 * PATIENCE_TICKS {
                return Err(Difference::new("rest", "moves for ever", "unknown"));
            }
        }
        Ok(())
    }

    fn delay(&mut self, us: u64) -> Result<(), Difference> {
        // At rest the ticks may be rare.
        if self.is_moving() && self.waiting.is_empty() {
            self.comparison.apart.late = true;
            self.pair.delay_tick(us);
        }
        self.wait(1)
    }

    /// Waits until both boards run again.
    pub(super) fn started(&mut self, start: impl FnOnce(&mut Pair, u32) -> bool) -> Result<(), Difference> {
        if !start(&mut self.pair, self.boots) {
            return Err(Difference::new("restart", "runs", self.pair.halted()));
        }
        self.comparison.restarted(&self.pair);
        self.wait(10)
    }

    fn reset(&mut self) -> Result<(), Difference> {
        self.boots += 1;
        (self.open, self.alive) = (false, true);
        self.waiting.clear();
        self.started(Pair::restart)
    }

    fn recover(&mut self) -> Result<(), Difference> {
        self.rest()?;
        for mishap in std::mem::take(&mut self.mishaps) {
            self.pair.with_plants(|plant| mishap.end(plant));
        }
        if self.comparison.apart.failing {
            self.wait(MEND_TICKS)?;
            self.comparison.apart.failing = false;
        }
        for _ in 0..2 {
            if let Some(fault) = self.pair.native().pose().fault {
                self.ask(&Request::ClearFault { seen: fault.seq });
                self.wait(MEND_TICKS)?;
            }
        }
        if self.pair.native().state() == ControllerState::Idle {
            self.act(&Act::Arm)?;
        }
        let referenced = self.pair.native().pose().referenced;
        if self.pair.native().state() == ControllerState::Ready && referenced != AxisMask::first(2) {
            self.ask(&Request::Home { axes: AxisMask::first(2) });
            self.wait(20)?;
            self.rest()?;
        }
        self.wait(10)
    }
}

/// One frame with this message.
pub(super) fn framed<M: Serialize>(kind: Kind, seq: u8, message: &M) -> Vec<u8> {
    let header = Header { major: PROTOCOL.major, kind, seq, ack: 0 };
    let mut frame = [0; MAX_FRAME];
    // Every request fits a frame.
    let length = encode(header, message, &mut frame).unwrap_or(0);
    frame[..length].to_vec()
}
