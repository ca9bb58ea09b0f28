//! A USB adapter between host and board: it delays bytes in both directions, and the host's clock drifts.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_protocol::Microseconds;

/// Bytes on their way, in order, with the time at which each arrives.
#[derive(Default)]
struct Pipe {
    bytes: VecDeque<(u64, u8)>,
    last: u64,
}

/// What an adapter does to bytes and to time.
#[derive(Clone, Copy, Debug)]
pub struct AdapterKind {
    /// The least time that a byte is under way, to the board and from it, in microseconds.
    pub latency_us: [u64; 2],
    /// A further delay of up to this, for the bytes of each look, in microseconds.
    pub jitter_us: u64,
    /// Bytes from the board are handed over at multiples of this, in microseconds.
    pub bundle_us: u64,
    /// How much faster the host's clock runs than true time, in parts per million.
    pub host_ppm: f64,
}

pub struct Adapter {
    kind: AdapterKind,
    /// A true time, and the host's clock then, in microseconds.
    since: (u64, u64),
    to_board: Pipe,
    from_board: Pipe,
    random: Pcg64Mcg,
}

impl Pipe {
    fn send(&mut self, at: u64, bytes: &[u8]) {
        // Bytes do not pass each other.
        self.last = self.last.max(at);
        self.bytes.extend(bytes.iter().map(|&byte| (self.last, byte)));
    }

    fn arrived(&mut self, now: u64) -> Vec<u8> {
        let count = self.bytes.iter().take_while(|(at, _)| *at <= now).count();
        self.bytes.drain(..count).map(|(_, byte)| byte).collect()
    }
}

impl Adapter {
    /// An adapter from a true time on, when the host's clock reads `clock`; both in microseconds.
    pub fn new(kind: AdapterKind, us: u64, clock: Microseconds) -> Self {
        let random = Pcg64Mcg::seed_from_u64(kind.jitter_us);
        Self { kind, since: (us, clock.0), to_board: Pipe::default(), from_board: Pipe::default(), random }
    }

    /// Behaves in another way from a true time on; bytes on their way arrive as they would have.
    pub fn become_kind(&mut self, kind: AdapterKind, us: u64) {
        self.since = (us, self.host_clock(us) as u64);
        self.kind = kind;
    }

    /// The host's clock at a true time, in microseconds and their fraction.
    pub fn host_clock(&self, us: u64) -> f64 {
        let (from, clock) = self.since;
        clock as f64 + (us - from) as f64 * (1.0 + self.kind.host_ppm * 1e-6)
    }

    /// How much faster an exact clock runs than the host's, in parts per million.
    pub fn board_ppm(&self) -> f64 {
        (1.0 / (1.0 + self.kind.host_ppm * 1e-6) - 1.0) * 1e6
    }

    fn delay(&mut self, way: usize) -> u64 {
        self.kind.latency_us[way] + self.random.random_range(0..=self.kind.jitter_us)
    }

    /// Takes bytes of the host and of the board at a true time; returns those that arrive by then at the board and at the
    /// host.
    pub fn pass(&mut self, us: u64, to_board: &[u8], from_board: &[u8]) -> [Vec<u8>; 2] {
        let at = us + self.delay(0);
        self.to_board.send(at, to_board);
        let at = (us + self.delay(1)).next_multiple_of(self.kind.bundle_us);
        self.from_board.send(at, from_board);
        [self.to_board.arrived(us), self.from_board.arrived(us)]
    }
}
