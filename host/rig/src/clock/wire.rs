//! The time that the frames of an exchange take on the wire.
//!
//! The reply is longer than the probe. Without this correction half of the difference would be an error of the offset.

use serde::Serialize;
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{MAX_FRAME, PROTOCOL, Report, Request};

use super::Exchange;

/// Bits on the wire per byte: start bit, eight data bits, stop bit.
const BITS_PER_BYTE: f64 = 10.0;
/// A timestamp may be this much early, in microseconds: FIFOs deliver before the last bit, adapters bundle by their own
/// clock.
const EARLY_US: f64 = 20.0;
/// Largest relative difference of the baud rates at both ends; at twice as much bytes are misread.
const BAUD_ERROR: f64 = 0.02;

/// The least time that each frame of an exchange takes, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WireTimes {
    /// The time of the probe, from host to board.
    pub probe_us: f64,
    /// The time of the reply, from board to host.
    pub reply_us: f64,
}

impl WireTimes {
    /// The times of an unknown wire: zero.
    pub(super) const NONE: Self = Self { probe_us: 0.0, reply_us: 0.0 };

    /// The times of both frames of `exchange`. Both are reduced by the same tolerance, so that it favours no direction.
    pub(super) fn of(exchange: &Exchange, baud: u32) -> Self {
        let Exchange { t0, t1, t2, .. } = *exchange;
        let byte_us = 1e6 * BITS_PER_BYTE / f64::from(baud.max(1));
        let probe = byte_us * frame_bytes(&Request::TimeProbe { t0 });
        let reply = byte_us * frame_bytes(&Report::TimeReply { t0, t1, t2 });
        let early = EARLY_US + BAUD_ERROR * reply.max(probe);
        Self { probe_us: (probe - early).max(0.0), reply_us: (reply - early).max(0.0) }
    }
}

/// The number of bytes of the frame that carries `body`, with its closing zero.
fn frame_bytes<B: Serialize>(body: &B) -> f64 {
    let header = Header { major: PROTOCOL.major, kind: Kind::Immediate, seq: 0, ack: 0 };
    encode(header, body, &mut [0; MAX_FRAME]).unwrap_or(0) as f64
}
