//! What one exchange says for certain.

use vergence_protocol::Microseconds;

use super::Exchange;
use super::line::WORST_DRIFT;
use super::wire::WireTimes;

/// Both clocks tell whole microseconds: an instant may be this much later than told.
const TICK_US: f64 = 1.0;

/// A limit of the board's clock less the host's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    /// When it holds, microseconds on the host's clock.
    pub host_us: f64,
    /// The limit, microseconds.
    pub offset_us: f64,
    /// Which limit.
    pub side: Side,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// The offset is no less.
    Least,
    /// The offset is no more.
    Most,
}

impl Exchange {
    /// The probe arrived no sooner than its bytes take: at `t0 + probe` the board's clock had not passed `t1`. The reply
    /// left no later than its bytes take: at `t3 - reply` the board's clock had reached `t2`.
    pub(super) fn limits(&self, wire: WireTimes) -> [Limit; 2] {
        let most = Limit {
            host_us: self.t0.0 as f64 + wire.probe_us,
            offset_us: difference(self.t1, self.t0) - wire.probe_us + TICK_US,
            side: Side::Most,
        };
        let least = Limit {
            host_us: self.t3.0 as f64 - wire.reply_us,
            offset_us: difference(self.t2, self.t3) + wire.reply_us - TICK_US,
            side: Side::Least,
        };
        [most, least]
    }

    /// Whether clocks that run forwards can have told these instants.
    pub(super) fn is_possible(&self) -> bool {
        self.t0 <= self.t3 && self.t1 <= self.t2 && !self.is_faster_than(WireTimes::NONE)
    }

    /// Whether less time passed on the host's clock than on the board's and the wire's together.
    pub(super) fn is_faster_than(&self, wire: WireTimes) -> bool {
        let away = difference(self.t3, self.t0);
        let explained = difference(self.t2, self.t1) + wire.probe_us + wire.reply_us;
        explained - away > WORST_DRIFT * away + 2.0 * TICK_US
    }
}

/// `later - earlier` in microseconds; either may be the later one.
pub(super) fn difference(later: Microseconds, earlier: Microseconds) -> f64 {
    later.0.wrapping_sub(earlier.0).cast_signed() as f64
}
