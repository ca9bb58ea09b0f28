//! The limits of the clock offset that one exchange sets.

use vergence_protocol::Microseconds;

use super::Exchange;
use super::wire::WireTimes;

/// Largest relative difference of two quartz oscillators.
pub(super) const WORST_DRIFT: f64 = 200e-6;
/// Resolution of both clocks in microseconds: an instant may be this much later than its timestamp.
const TICK_US: f64 = 1.0;

/// A limit of the clock offset, which is the board's clock less the host's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    /// The instant at which it holds, in microseconds on the host's clock.
    pub host_us: f64,
    /// The limit in microseconds.
    pub offset_us: f64,
    /// Whether it is a lower or an upper limit.
    pub side: Side,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// A lower limit.
    Least,
    /// An upper limit.
    Most,
}

impl Exchange {
    /// The limits of the offset. The probe needs the time of its bytes to arrive, so at `t0 + probe` the board's clock
    /// had not passed `t1`. The reply needs the time of its bytes too, so at `t3 - reply` the board's clock had reached
    /// `t2`.
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

    /// Whether clocks that run forwards can give these timestamps.
    pub(super) fn is_possible(&self) -> bool {
        self.t0 <= self.t3 && self.t1 <= self.t2 && !self.is_faster_than(WireTimes::NONE)
    }

    /// Whether less time passed on the host's clock than the board and the wire together took.
    pub(super) fn is_faster_than(&self, wire: WireTimes) -> bool {
        let away = difference(self.t3, self.t0);
        let explained = difference(self.t2, self.t1) + wire.probe_us + wire.reply_us;
        explained - away > WORST_DRIFT * away + 2.0 * TICK_US
    }
}

/// Returns `later - earlier` in microseconds, of either sign.
pub(super) fn difference(later: Microseconds, earlier: Microseconds) -> f64 {
    later.0.wrapping_sub(earlier.0).cast_signed() as f64
}
