//! Both ends joined by a simulated line in virtual time.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_protocol::{
    BoardEvent, BoardSession, Compatibility, HostEvent, HostSession, MAX_FRAME, Microseconds, ReplyTo, Report, Request,
    SubmitError, Ticket,
};

use super::{SESSION, answer, pose};

/// Time of one byte at 1 000 000 baud, microseconds.
pub const BYTE: u64 = 10;
/// What a line does to frames, as probabilities.
#[derive(Clone, Copy, Default)]
pub struct Noise {
    pub lose: f64,
    /// Change, lose or insert one byte.
    pub damage: f64,
    pub duplicate: f64,
}

/// One direction of a serial line: it keeps the order and takes its time.
pub struct Wire {
    pub noise: Noise,
    rng: Pcg64Mcg,
    pub free_at: u64,
    in_flight: VecDeque<(u64, Vec<u8>)>,
}

impl Wire {
    pub fn new(noise: Noise, seed: u64) -> Self {
        Self { noise, rng: Pcg64Mcg::seed_from_u64(seed), free_at: 0, in_flight: VecDeque::new() }
    }

    pub fn send(&mut self, now: u64, frame: &[u8]) {
        let copies = if self.rng.random_bool(self.noise.duplicate) { 2 } else { 1 };
        for _ in 0..copies {
            let latency = self.rng.random_range(0..1000);
            self.free_at = (self.free_at.max(now) + BYTE * frame.len() as u64).max(now + latency);
            if self.rng.random_bool(self.noise.lose) {
                continue;
            }
            let mut bytes = frame.to_vec();
            if self.rng.random_bool(self.noise.damage) {
                let at = self.rng.random_range(0..bytes.len());
                match self.rng.random_range(0..3) {
                    0 => bytes[at] = self.rng.random(),
                    1 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, self.rng.random()),
                }
            }
            self.in_flight.push_back((self.free_at, bytes));
        }
    }

    pub fn next(&self) -> Option<u64> {
        self.in_flight.front().map(|(at, _)| *at)
    }

    pub fn arrived(&mut self, now: u64) -> Option<Vec<u8>> {
        self.in_flight.pop_front_if(|(at, _)| *at <= now).map(|(_, bytes)| bytes)
    }
}

/// Two ends, two wires, and a board program that answers after a while and streams poses.
pub struct Rig {
    pub now: u64,
    pub host: HostSession,
    pub board: BoardSession,
    pub up: Wire,
    pub down: Wire,
    pub events: Vec<HostEvent>,
    pub executed: Vec<Request>,
    pub opened: usize,
    thinking: VecDeque<(u64, ReplyTo, Report)>,
    pub think: u64,
    pose_at: u64,
    pose_seq: u16,
}

pub const POSE_PERIOD: u64 = 2_000;

impl Rig {
    pub fn new(noise: Noise, seed: u64) -> Self {
        Self {
            now: 0,
            host: HostSession::new(SESSION),
            board: BoardSession::new(77),
            up: Wire::new(noise, 2 * seed),
            down: Wire::new(noise, 2 * seed + 1),
            events: Vec::new(),
            executed: Vec::new(),
            opened: 0,
            thinking: VecDeque::new(),
            think: 0,
            pose_at: 0,
            pose_seq: 0,
        }
    }

    pub fn opened(noise: Noise, seed: u64) -> Self {
        let mut rig = Self::new(noise, seed);
        rig.host.hello();
        assert!(rig.run(10_000_000, |rig| rig.host.is_open()), "seed {seed}: did not open");
        assert_eq!(rig.events[0], HostEvent::Opened { compatibility: Compatibility::Full, boot: 77 });
        rig.events.clear();
        rig
    }

    pub fn submit(&mut self, request: Request) -> Result<Ticket, SubmitError> {
        self.host.submit(Microseconds(self.now), request)
    }

    /// Lets time pass until `done` or for `limit` microseconds; whether it was done.
    pub fn run(&mut self, limit: u64, done: impl Fn(&Self) -> bool) -> bool {
        let end = self.now + limit;
        loop {
            self.step();
            if done(self) {
                return true;
            }
            let wake = self.host.next_wake().map(|wake| wake.0);
            let thought = self.thinking.front().map(|(at, ..)| *at);
            let line = Some(self.up.free_at).filter(|at| *at > self.now);
            let times = [wake, thought, line, self.up.next(), self.down.next(), Some(self.pose_at), Some(end)];
            let next = times.into_iter().flatten().min().unwrap();
            assert!(next > self.now || next == end, "time stands still at {next}");
            if next >= end {
                self.now = end;
                return false;
            }
            self.now = next;
        }
    }

    /// Everything that happens now.
    pub fn step(&mut self) {
        let now = Microseconds(self.now);
        let mut buffer = [0; MAX_FRAME];
        while let Some(bytes) = self.down.arrived(self.now) {
            for byte in bytes {
                match self.board.receive(now, byte) {
                    Some(BoardEvent::Opened { .. }) => self.opened += 1,
                    Some(BoardEvent::Request { reply_to, request, .. }) => {
                        self.thinking.push_back((self.now + self.think, reply_to, answer(&request)));
                        self.executed.push(request);
                    }
                    Some(BoardEvent::Management { .. }) | None => {}
                }
            }
        }
        while let Some((_, reply_to, report)) = self.thinking.pop_front_if(|(at, ..)| *at <= self.now) {
            self.board.reply(reply_to, report);
        }
        if self.pose_at <= self.now {
            self.pose_at = self.now + POSE_PERIOD;
            self.board.telemetry(pose(self.pose_seq));
            self.pose_seq = self.pose_seq.wrapping_add(1);
        }
        // The line takes one frame at a time: what waits for it waits in the session.
        if self.up.free_at <= self.now
            && let Some(length) = self.board.transmit(now, &mut buffer)
        {
            self.up.send(self.now, &buffer[..length]);
        }
        while let Some(bytes) = self.up.arrived(self.now) {
            self.host.receive(now, &bytes, |event| self.events.push(event));
        }
        while let Some(length) = self.host.transmit(now, &mut buffer) {
            self.down.send(self.now, &buffer[..length]);
        }
    }
}
