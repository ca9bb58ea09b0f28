//! A simulated link and board in virtual time, with the true relation of both clocks.

use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{MAX_FRAME, Microseconds, PROTOCOL, Report, Request};
use vergence_rig::{ClockMap, Exchange};

/// Interval between changes of the board's drift, in microseconds.
const STEP_US: f64 = 100_000.0;
/// Interval that is no multiple of a USB frame or a latency timer.
const FAST_PERIOD_US: f64 = 98_390.0;
const SLOW_PERIOD_US: f64 = 983_900.0;

/// Steele, Lea and Flood, "Fast splittable pseudorandom number generators" (OOPSLA 2014).
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.unit()
    }

    fn gaussian(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

/// A board's clock that started some time ago, is off by 80 ppm, and whose drift walks at random by 1 ppm in a minute.
struct BoardClock {
    /// Reading of the board's clock at each step of the host's clock.
    shown: Vec<f64>,
}

impl BoardClock {
    fn new(random: &mut SplitMix, seconds: f64) -> Self {
        let mut drift = if random.unit() < 0.5 { 80e-6 } else { -80e-6 };
        let mut shown = vec![random.between(0.0, 1e10)];
        for _ in 0..(seconds * 1e6 / STEP_US) as usize + 20 {
            shown.push(shown[shown.len() - 1] + STEP_US * (1.0 + drift));
            drift += 1e-6 * (STEP_US / 60e6).sqrt() * random.gaussian();
        }
        Self { shown }
    }

    fn at(&self, host: f64) -> f64 {
        let step = (host / STEP_US) as usize;
        let (from, to) = (self.shown[step], self.shown[step + 1]);
        from + (to - from) * (host / STEP_US - step as f64)
    }
}

/// The delay of a message beyond its bytes, as its timestamps show it; a timestamp may be early.
#[derive(Clone, Copy, Debug)]
pub enum Delay {
    /// Uniform between two values in microseconds.
    Uniform(f64, f64),
    /// Waits for the next tick of a latency timer of 16 ms, and a millisecond for the transfer.
    LatencyTimer,
    /// Up to 40 us, and in bursts of some seconds up to this much more.
    Bursts(f64),
}

impl Delay {
    fn of(self, random: &mut SplitMix, host: f64) -> f64 {
        match self {
            Self::Uniform(least, most) => random.between(least, most),
            // The timer has a crystal of its own.
            Self::LatencyTimer => 1_000.0 + 16_000.8 - host % 16_000.8,
            Self::Bursts(most) => {
                let burst = (host / 3e6) as u64 % 5 >= 3;
                random.between(0.0, 40.0) + if burst { random.between(0.0, most) } else { 0.0 }
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Link {
    pub baud: Option<u32>,
    pub down: Delay,
    pub up: Delay,
    /// Fraction of exchanges that are lost.
    pub loss: f64,
}

/// The error of one conversion with the stated bound, and the error of converting there and back.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Instant on the host's clock.
    pub at_us: f64,
    pub error_us: f64,
    pub bound_us: f64,
    pub round_trip_us: f64,
    pub round_trip_bound_us: f64,
}

impl Link {
    /// Runs exchanges like a client for some seconds, and converts an instant every 50 ms.
    pub fn run(self, seed: u64, mut map: ClockMap, seconds: f64) -> Vec<Outcome> {
        let mut random = SplitMix(seed);
        let board = BoardClock::new(&mut random, seconds);
        let mut exchanges = self.exchanges(&mut random, &board, seconds).into_iter().peekable();
        let instants = (1..(seconds * 20.0) as u64).map(|step| step * 50_000);
        let convert = |now| {
            while let Some(exchange) = exchanges.next_if(|exchange| exchange.t3.0 <= now) {
                map.observe(exchange);
            }
            outcome(&map, &board, now)
        };
        instants.filter_map(convert).collect()
    }

    /// The exchanges that are not lost, in order.
    fn exchanges(self, random: &mut SplitMix, board: &BoardClock, seconds: f64) -> Vec<Exchange> {
        let sent = (0..10 + seconds as u32)
            .map(|n| 1_000.0 + FAST_PERIOD_US * f64::from(n.min(10)) + SLOW_PERIOD_US * f64::from(n.max(10) - 10));
        let exchange = |sent| {
            let exchange = self.exchange(random, board, sent);
            (random.unit() >= self.loss).then_some(exchange)
        };
        sent.filter_map(exchange).collect()
    }

    fn exchange(self, random: &mut SplitMix, board: &BoardClock, sent: f64) -> Exchange {
        let micro = |us: f64| Microseconds(us as u64);
        let t0 = micro(sent);
        let arrived = sent + self.wire_us(&Request::TimeProbe { t0 }) + self.down.of(random, sent);
        let left = arrived + random.between(20.0, 1_000.0);
        let (t1, t2) = (micro(board.at(arrived)), micro(board.at(left)));
        let returned = left + self.wire_us(&Report::TimeReply { t0, t1, t2 }) + self.up.of(random, left);
        Exchange { t0, t1, t2, t3: micro(returned) }
    }

    fn wire_us<B: serde::Serialize>(self, body: &B) -> f64 {
        let header = Header { major: PROTOCOL.major, kind: Kind::Immediate, seq: 1, ack: 1 };
        let bytes = encode(header, body, &mut [0; MAX_FRAME]).expect("fits");
        self.baud.map_or(0.0, |baud| bytes as f64 * 10e6 / f64::from(baud))
    }
}

fn outcome(map: &ClockMap, board: &BoardClock, now: u64) -> Option<Outcome> {
    let stated = map.board_at(Microseconds(now))?;
    let back = map.host_at(Microseconds(stated.us.round() as u64))?;
    Some(Outcome {
        at_us: now as f64,
        error_us: (stated.us - board.at(now as f64)).abs(),
        bound_us: stated.error_us,
        round_trip_us: (back.us - now as f64).abs(),
        round_trip_bound_us: back.error_us,
    })
}
