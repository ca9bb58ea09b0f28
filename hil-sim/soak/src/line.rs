//! One direction of a serial line, with delays and errors.

use std::collections::VecDeque;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vergence_protocol::Microseconds;

/// Duration of a byte of ten bits at 921 600 baud, in nanoseconds.
const BYTE_NS: u64 = 10_851;

/// Probabilities of the errors that occur all the time.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineFaults {
    /// Probability that a byte is damaged.
    pub byte_errors: f64,
    /// Probability that a frame, or its end, is lost.
    pub drops: f64,
    /// Probability that a frame comes twice.
    pub duplicates: f64,
}

/// Bytes on their way, in order.
#[derive(Debug)]
pub struct Line {
    faults: LineFaults,
    latency_us: u64,
    random: Pcg64Mcg,
    /// Bytes that pass undamaged before the next damaged one.
    good_bytes: u64,
    bytes: VecDeque<u8>,
    /// Arrival times, with the number of bytes that arrive then.
    arrivals: VecDeque<(u64, usize)>,
    /// Time at which the wire is free again, in nanoseconds.
    busy_until_ns: u64,
    held_until: u64,
    cut_until: u64,
}

impl Line {
    /// A quiet line, whose errors begin with the first byte.
    pub fn new(faults: LineFaults, latency_us: u64, random: Pcg64Mcg) -> Self {
        let mut line = Self {
            faults,
            latency_us,
            random,
            good_bytes: 0,
            bytes: VecDeque::new(),
            arrivals: VecDeque::new(),
            busy_until_ns: 0,
            held_until: 0,
            cut_until: 0,
        };
        line.good_bytes = line.bytes_to_next_error();
        line
    }

    /// Delivers nothing before `until`; nothing is lost.
    pub fn hold(&mut self, until: Microseconds) {
        self.held_until = until.0;
    }

    /// Loses the bytes on their way and those sent before `until`.
    pub fn cut(&mut self, until: Microseconds) {
        self.cut_until = until.0;
        self.bytes.clear();
        self.arrivals.clear();
    }

    /// Sends one frame.
    pub fn send(&mut self, now: Microseconds, frame: &[u8]) {
        if now.0 < self.cut_until {
            return;
        }
        let copies = if self.happens(self.faults.duplicates) { 2 } else { 1 };
        for _ in 0..copies {
            let kept =
                if self.happens(self.faults.drops) { self.random.random_range(0..frame.len()) } else { frame.len() };
            self.transfer(now, &frame[..kept]);
        }
    }

    /// Appends the bytes that have arrived by `now` to `into`.
    pub fn deliver(&mut self, now: Microseconds, into: &mut Vec<u8>) {
        if now.0 < self.held_until {
            return;
        }
        while let Some(&(at, count)) = self.arrivals.front()
            && at <= now.0
        {
            self.arrivals.pop_front();
            into.extend(self.bytes.drain(..count));
        }
    }

    fn transfer(&mut self, now: Microseconds, bytes: &[u8]) {
        self.busy_until_ns = self.busy_until_ns.max(now.0 * 1000) + BYTE_NS * bytes.len() as u64;
        self.arrivals.push_back((self.busy_until_ns / 1000 + self.latency_us, bytes.len()));
        for &byte in bytes {
            let damage = if self.good_bytes == 0 {
                self.good_bytes = self.bytes_to_next_error();
                self.random.random_range(1..=u8::MAX)
            } else {
                self.good_bytes -= 1;
                0
            };
            self.bytes.push_back(byte ^ damage);
        }
    }

    fn happens(&mut self, probability: f64) -> bool {
        probability > 0.0 && self.random.random_bool(probability)
    }

    /// Draws the number of undamaged bytes before the next damaged one: geometrically distributed.
    fn bytes_to_next_error(&mut self) -> u64 {
        let p = self.faults.byte_errors;
        if p <= 0.0 {
            return u64::MAX;
        }
        let u: f64 = 1.0 - self.random.random::<f64>();
        (u.ln() / (-p).ln_1p()) as u64
    }
}
