//! Which instant on the board's clock an instant on the host's clock is, and the other way round.
//!
//! Every exchange of four timestamps (D. Mills, RFC 5905 §8) limits the board's clock from both sides: the probe cannot
//! arrive before it was sent, nor the reply leave after it was heard, each by the time its bytes take on the wire. A line
//! of offset and drift is laid between the limits of the last minutes, by linear programming as in Moon, Skelly and
//! Towsley, "Estimation and removal of clock skew from network delay measurements" (INFOCOM 1999). Only the quickest
//! probes and the quickest replies touch that line: a minimum filter for each direction, so one leg that was delayed,
//! by whatever time, moves nothing. What the limits leave open is the error that is stated.

mod limit;
mod line;
mod wire;

use std::collections::VecDeque;

use line::Lines;
use vergence_protocol::Microseconds;
use wire::WireTimes;

/// How many exchanges are remembered: two minutes at one each second. Older ones tell less than the drift has changed.
const KEPT: usize = 128;
/// The clock is lost when more probes than this are without answer.
const MOST_UNANSWERED: u32 = 4;

/// One probe and its reply: sent and received on the host clock, arrived and left on the board clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// Host sent the probe.
    pub t0: Microseconds,
    /// Board received it.
    pub t1: Microseconds,
    /// Board sent the reply.
    pub t2: Microseconds,
    /// Host received it.
    pub t3: Microseconds,
}

/// An instant on the board's clock and how far it may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardInstant {
    /// Microseconds since the board started.
    pub us: f64,
    /// Microseconds; with at least 95 % probability the error is no larger, and nothing is known of it within: treat it
    /// as uniform over plus or minus this.
    pub error_us: f64,
}

/// An instant on the host's clock and how far it may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostInstant {
    /// Microseconds on the host's clock.
    pub us: f64,
    /// As of [`BoardInstant::error_us`].
    pub error_us: f64,
}

/// How much faster than the host's clock the board's runs, at the latest exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockDrift {
    /// Parts per million; negative where the board is slower.
    pub ppm: f64,
    /// Bound of its error in parts per million, as of [`BoardInstant::error_us`].
    pub error_ppm: f64,
}

/// The relation of the two clocks.
///
/// [`Default`] knows nothing of the wire and takes all of the round trip for delay; [`at_baud`](Self::at_baud) knows how
/// long the frames themselves take.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    baud: Option<u32>,
    unanswered: u32,
    exchanges: VecDeque<Timed>,
    lines: Option<Lines>,
}

/// An exchange and what of it the wire took.
#[derive(Clone, Copy, Debug)]
struct Timed {
    exchange: Exchange,
    wire: WireTimes,
}

impl ClockMap {
    /// Over a wire of `baud` bits each second and ten bits to a byte. Where exchanges are faster than that, as on a USB
    /// port that only pretends to have a baud rate, it is no longer believed.
    #[must_use]
    pub fn at_baud(baud: u32) -> Self {
        Self { baud: Some(baud), ..Self::default() }
    }

    /// A probe goes out.
    pub fn probe_sent(&mut self) {
        self.unanswered = self.unanswered.saturating_add(1);
    }

    /// Takes one exchange. One that cannot have happened, such as a reply before its probe, only counts as an answer; one
    /// that contradicts earlier exchanges makes them forgotten, for then the board began anew.
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

    /// The board's clock at `host` on the host's clock; `None` before the first exchange. It never runs backwards
    /// between two exchanges, and the error grows with the distance from the latest.
    #[must_use]
    pub fn board_at(&self, host: Microseconds) -> Option<BoardInstant> {
        let offset = self.lines.as_ref()?.offset_at(host.0 as f64);
        Some(BoardInstant { us: host.0 as f64 + offset.middle, error_us: offset.error })
    }

    /// The host's clock at `board` on the board's clock, the inverse of [`board_at`](Self::board_at); `None` before the
    /// first exchange.
    #[must_use]
    pub fn host_at(&self, board: Microseconds) -> Option<HostInstant> {
        let lines = self.lines.as_ref()?;
        let board = board.0 as f64;
        // The offset changes by less than a thousandth of the time, so each pass leaves a thousandth of the error: from
        // a day, below a nanosecond.
        let host = (0..6).fold(lines.reference(), |host, _| board - lines.offset_at(host).middle);
        Some(HostInstant { us: host, error_us: lines.offset_at(host).error })
    }

    /// The drift; `None` before the first exchange.
    #[must_use]
    pub fn drift(&self) -> Option<ClockDrift> {
        let drift = self.lines.as_ref()?.drift();
        Some(ClockDrift { ppm: drift.middle * 1e6, error_ppm: drift.error * 1e6 })
    }

    /// Whether four probes went unanswered and a fifth is on its way. The next exchange ends it.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.unanswered > MOST_UNANSWERED
    }

    /// From the newest exchange back to the first that contradicts those after it; that one and all before are forgotten.
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
