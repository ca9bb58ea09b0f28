//! What the live loop hears, in the order in which it hears it: all that a replay needs beside the images.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use vergence_protocol::{Microseconds, PoseReport, TriggerMark};
use vergence_rig::{Exchange, ExposureTiming, HostInstant, StampedImage};
use vergence_vision::Side;

/// One thing that the live loop hears.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The recording begins.
    Begun(Beginning),
    /// The board reported its encoders.
    Pose(PoseReport),
    /// The board fired the cameras.
    Pulse(TriggerMark),
    /// The host asked the board for its time.
    ProbeSent,
    /// The board told its time: the four stamps of an [`Exchange`] in microseconds.
    Exchange([u64; 4]),
    /// A camera is there.
    Attached(Eye, Timing),
    /// A camera took the image that was written just before.
    Image(Eye, Stamp),
    /// A camera is gone, and why.
    Lost(Eye, String),
    /// The link to the board ended.
    LinkEnded,
    /// The link to the board is there again.
    LinkBack,
}

/// What a replay must know before the first event.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beginning {
    /// Whether the rig has a board.
    pub has_board: bool,
    /// The speed of the wire to it in bits per second; `None` where bytes take no time.
    pub baud: Option<u32>,
    /// Time between pulses of the trigger in microseconds; `None` where the cameras run freely.
    pub period_us: Option<f64>,
}

/// A camera of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Eye {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Eye {
    /// Its place in the pair.
    #[must_use]
    pub const fn side(self) -> Side {
        match self {
            Self::Left => Side::Left,
            Self::Right => Side::Right,
        }
    }

    /// The name in topics and frames.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

impl From<Side> for Eye {
    fn from(side: Side) -> Self {
        match side {
            Side::Left => Self::Left,
            Side::Right => Self::Right,
        }
    }
}

/// The timing of a camera's exposures in nanoseconds, as [`ExposureTiming`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timing {
    period: u64,
    exposure: Option<u64>,
    rolling: u64,
    readout: u64,
}

impl From<ExposureTiming> for Timing {
    fn from(timing: ExposureTiming) -> Self {
        let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        Self {
            period: ns(timing.period),
            exposure: timing.exposure.map(ns),
            rolling: ns(timing.rolling),
            readout: ns(timing.readout),
        }
    }
}

impl From<Timing> for ExposureTiming {
    fn from(timing: Timing) -> Self {
        Self {
            period: Duration::from_nanos(timing.period),
            exposure: timing.exposure.map(Duration::from_nanos),
            rolling: Duration::from_nanos(timing.rolling),
            readout: Duration::from_nanos(timing.readout),
        }
    }
}

/// Number and time of an image, on the host's clock, as [`StampedImage`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// The camera's own number of the image.
    pub seq: u32,
    /// Middle of the exposure of the middle row in microseconds.
    pub middle_us: f64,
    /// Bound of its error in microseconds.
    pub error_us: f64,
}

impl From<Stamp> for StampedImage {
    fn from(stamp: Stamp) -> Self {
        Self { seq: stamp.seq, middle: HostInstant { us: stamp.middle_us, error_us: stamp.error_us } }
    }
}

impl From<Exchange> for Event {
    fn from(exchange: Exchange) -> Self {
        Self::Exchange([exchange.t0, exchange.t1, exchange.t2, exchange.t3].map(|time| time.0))
    }
}

/// The exchange with these four stamps.
#[must_use]
pub fn exchange_of(stamps: [u64; 4]) -> Exchange {
    let [t0, t1, t2, t3] = stamps.map(Microseconds);
    Exchange { t0, t1, t2, t3 }
}
