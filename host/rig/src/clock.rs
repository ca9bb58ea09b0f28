//! Conversion of instants between the board's clock and the host's.
//!
//! Every exchange of four timestamps (D. Mills, RFC 5905 §8) limits the offset of the board's clock from both sides:
//! the probe cannot arrive before it was sent, and the reply cannot leave after it was received, each by the time its
//! bytes take on the wire. The lines of offset and drift that the limits of the last minutes allow are found by linear
//! programming, as in Moon, Skelly and Towsley, "Estimation and removal of clock skew from network delay measurements"
//! (INFOCOM 1999). Only the quickest probes and replies constrain them, which is a minimum filter for each direction: a
//! message delayed by any time has no effect. The stated error is the range that the limits leave.

mod limit;
mod line;
mod wire;

use std::collections::VecDeque;

use line::Lines;
use vergence_protocol::Microseconds;
use wire::WireTimes;

/// Number of exchanges kept: two minutes at one each second. Over a longer time the drift changes by more than they
/// tell.
const KEPT: usize = 128;
/// The clock counts as lost when more probes than this are unanswered.
const MOST_UNANSWERED: u32 = 4;

/// The four timestamps of a probe and its reply: `t0` and `t3` on the host's clock, `t1` and `t2` on the board's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// The host sent the probe.
    pub t0: Microseconds,
    /// The board received the probe.
    pub t1: Microseconds,
    /// The board sent the reply.
    pub t2: Microseconds,
    /// The host received the reply.
    pub t3: Microseconds,
}

/// An instant on the board's clock with the bound of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardInstant {
    /// Microseconds since the board started.
    pub us: f64,
    /// Bound of the error in microseconds, which holds with at least 95 % probability. Within it the error counts as
    /// uniform.
    pub error_us: f64,
}

/// An instant on the host's clock with the bound of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostInstant {
    /// Microseconds on the host's clock.
    pub us: f64,
    /// Bound of the error in microseconds, like [`BoardInstant::error_us`].
    pub error_us: f64,
}

/// The drift of the board's clock against the host's, at the latest exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockDrift {
    /// Drift in parts per million; negative where the board's clock is slower.
    pub ppm: f64,
    /// Bound of its error in parts per million, like [`BoardInstant::error_us`].
    pub error_ppm: f64,
}

/// The estimated relation of the board's clock and the host's.
///
/// [`Default`] counts the whole round trip as unknown delay; [`at_baud`](Self::at_baud) subtracts the time that the
/// frames themselves take on the wire.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    baud: Option<u32>,
    unanswered: u32,
    exchanges: VecDeque<Timed>,
    lines: Option<Lines>,
}

/// An exchange with the time that its frames took on the wire.
#[derive(Clone, Copy, Debug)]
struct Timed {
    exchange: Exchange,
    wire: WireTimes,
}

impl ClockMap {
    /// Makes a map for a wire of `baud` bits per second and ten bits per byte. The baud rate is dropped once an
    /// exchange is faster than it allows, as on a USB port where it has no meaning.
    #[must_use]
    pub fn at_baud(baud: u32) -> Self {
        Self { baud: Some(baud), ..Self::default() }
    }

    /// Counts a probe that was sent.
    pub fn probe_sent(&mut self) {
        self.unanswered = self.unanswered.saturating_add(1);
    }

    /// Adds an exchange. An impossible one, such as a reply before its probe, only counts as an answer. One that
    /// contradicts earlier exchanges discards them, because the board has restarted.
    pub fn observe(&mut self, exchange: Exchange) {
        self.unanswered = 0;
        if !exchange.is_possible() {
            return;
        }
        let wire = self.baud.map_or(WireTimes::NONE, |baud| WireTimes::of(&exchange, baud));
        if exchange.is_faster_than(wire) {
            self.baud = None;
            self.exchanges.iter_mut().for_each(|timed| timed.wire = WireTimes::NONE);
        }
        if self.exchanges.len() == KEPT {
            self.exchanges.pop_front();
        }
        let wire = if self.baud.is_some() { wire } else { WireTimes::NONE };
        self.exchanges.push_back(Timed { exchange, wire });
        self.lay_lines();
    }

    /// Converts `host` on the host's clock to the board's clock; `None` before the first exchange.
    ///
    /// Between two exchanges the result never runs backwards, and its error grows with the distance from the latest
    /// exchange.
    #[must_use]
    pub fn board_at(&self, host: Microseconds) -> Option<BoardInstant> {
        let offset = self.lines.as_ref()?.offset_at(host.0 as f64);
        Some(BoardInstant { us: host.0 as f64 + offset.middle, error_us: offset.error })
    }

    /// Converts `board` on the board's clock to the host's clock, the inverse of [`board_at`](Self::board_at); `None`
    /// before the first exchange.
    #[must_use]
    pub fn host_at(&self, board: Microseconds) -> Option<HostInstant> {
        let lines = self.lines.as_ref()?;
        let board = board.0 as f64;
        // The offset changes by less than a thousandth of the time, so each pass reduces the error to a thousandth:
        // from a day to below a nanosecond.
        let host = (0..6).fold(lines.reference(), |host, _| board - lines.offset_at(host).middle);
        Some(HostInstant { us: host, error_us: lines.offset_at(host).error })
    }

    /// The drift of the board's clock; `None` before the first exchange.
    #[must_use]
    pub fn drift(&self) -> Option<ClockDrift> {
        let drift = self.lines.as_ref()?.drift();
        Some(ClockDrift { ppm: drift.middle * 1e6, error_ppm: drift.error * 1e6 })
    }

    /// Whether the clock is lost: four probes are unanswered and a fifth is sent. The next exchange ends this state.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.unanswered > MOST_UNANSWERED
    }

    /// Applies the limits from the newest exchange back to the first that contradicts later ones; that one and all
    /// older ones are discarded.
    fn lay_lines(&mut self) {
        self.lines = self.exchanges.back().and_then(|newest| Lines::through(&newest.exchange));
        let mut agreeing = 0;
        for Timed { exchange, wire } in self.exchanges.iter().rev() {
            let narrowed = self.lines.as_ref().and_then(|lines| lines.narrowed(exchange.limits(*wire)));
            let Some(narrowed) = narrowed else { break };
            self.lines = Some(narrowed);
            agreeing += 1;
        }
        self.exchanges.drain(..self.exchanges.len() - agreeing);
    }
}
