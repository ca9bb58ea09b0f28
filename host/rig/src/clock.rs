//! Which instant on the board's clock an instant on the host's clock is.
//!
//! Four-timestamp exchange (D. Mills, RFC 5905 §8). The offset of the exchange with the shortest round trip is kept; half
//! of that round trip bounds its error, and the bound grows with age by the worst drift of two quartz clocks.

use std::collections::VecDeque;

use vergence_protocol::Microseconds;

/// Two quartz oscillators differ by less than this, parts in one.
const WORST_DRIFT: f64 = 200e-6;
/// How many exchanges are remembered.
const KEPT: usize = 32;

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
    /// Bound of the error in microseconds.
    pub error_us: f64,
}

/// The relation of the two clocks.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    exchanges: VecDeque<Exchange>,
}

impl Exchange {
    fn round_trip(&self) -> f64 {
        difference(self.t3, self.t0) - difference(self.t2, self.t1)
    }

    /// Board clock less host clock.
    fn offset(&self) -> f64 {
        0.5 * (difference(self.t1, self.t0) + difference(self.t2, self.t3))
    }

    fn error_at(&self, host: Microseconds) -> f64 {
        0.5 * self.round_trip().max(0.0) + WORST_DRIFT * difference(host, self.t3).abs()
    }
}

impl ClockMap {
    /// Takes one exchange.
    pub fn observe(&mut self, exchange: Exchange) {
        if self.exchanges.len() == KEPT {
            self.exchanges.pop_front();
        }
        self.exchanges.push_back(exchange);
    }

    /// The board's clock at `host` on the host's clock; `None` before the first exchange.
    #[must_use]
    pub fn board_at(&self, host: Microseconds) -> Option<BoardInstant> {
        let best = self.exchanges.iter().min_by(|a, b| a.error_at(host).total_cmp(&b.error_at(host)))?;
        Some(BoardInstant { us: host.0 as f64 + best.offset(), error_us: best.error_at(host) })
    }
}

/// `later - earlier` in microseconds; either may be the later one.
fn difference(later: Microseconds, earlier: Microseconds) -> f64 {
    later.0.wrapping_sub(earlier.0).cast_signed() as f64
}
