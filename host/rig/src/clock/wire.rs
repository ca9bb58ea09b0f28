//! How long the frames of an exchange take on the wire. The reply is longer than the probe: without this, half of the
//! difference would be an error of the offset.

use serde::Serialize;
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{MAX_FRAME, PROTOCOL, Report, Request};

use super::Exchange;

/// Start, eight data bits, stop.
const BITS_PER_BYTE: f64 = 10.0;
/// A stamp may be this much early: FIFOs hand over before the last bit, adapters pack by their own clock.
const EARLY_US: f64 = 20.0;
/// The two ends' baud rates may differ by this, parts in one; at twice as much bytes are misread.
const BAUD_ERROR: f64 = 0.02;

/// The least time that each frame takes, microseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WireTimes {
    /// Probe, host to board.
    pub probe_us: f64,
    /// Reply, board to host.
    pub reply_us: f64,
}

impl WireTimes {
    /// No wire, or an unknown one.
    pub(super) const NONE: Self = Self { probe_us: 0.0, reply_us: 0.0 };

    /// Of the two frames of `exchange`. Both are shortened alike: what is not known must not favour one direction.
    pub(super) fn of(exchange: &Exchange, baud: u32) -> Self {
        let Exchange { t0, t1, t2, .. } = *exchange;
        let byte_us = 1e6 * BITS_PER_BYTE / f64::from(baud.max(1));
        let probe = byte_us * frame_bytes(&Request::TimeProbe { t0 });
        let reply = byte_us * frame_bytes(&Report::TimeReply { t0, t1, t2 });
        let early = EARLY_US + BAUD_ERROR * reply.max(probe);
        Self { probe_us: (probe - early).max(0.0), reply_us: (reply - early).max(0.0) }
    }
}

/// Bytes of the frame that carries `body`, its closing zero included.
fn frame_bytes<B: Serialize>(body: &B) -> f64 {
    let header = Header { major: PROTOCOL.major, kind: Kind::Immediate, seq: 0, ack: 0 };
    encode(header, body, &mut [0; MAX_FRAME]).unwrap_or(0) as f64
}
