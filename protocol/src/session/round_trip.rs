//! Time-out for answers, from measured round trips (RFC 6298, with bounds for a serial line).

use crate::Microseconds;

/// Time-out before the first measurement, in microseconds.
const START: u64 = 20_000;
/// Bounds of the time-out, in microseconds.
const MIN: u64 = 5_000;
const MAX: u64 = 250_000;

/// Smoothed round-trip time and its variation, in microseconds.
#[derive(Debug)]
pub(super) struct RoundTrip {
    smoothed: Option<u64>,
    variation: u64,
    timeout: u64,
}

impl RoundTrip {
    pub(super) const fn new() -> Self {
        Self { smoothed: None, variation: 0, timeout: START }
    }

    /// Takes one measured round trip in microseconds and ends a back-off. The measurement must come from a request that was
    /// sent only once (Karn and Partridge, "Improving Round-Trip Time Estimates in Reliable Transport Protocols", SIGCOMM
    /// 1987).
    pub(super) fn sample(&mut self, sample: u64) {
        let sample = sample.min(MAX);
        let smoothed = match self.smoothed {
            None => {
                self.variation = sample / 2;
                sample
            }
            Some(smoothed) => {
                self.variation = (3 * self.variation + smoothed.abs_diff(sample)) / 4;
                (7 * smoothed + sample) / 8
            }
        };
        self.smoothed = Some(smoothed);
        self.timeout = (smoothed + 4 * self.variation).clamp(MIN, MAX);
    }

    /// Doubles the time-out, after a request has timed out.
    pub(super) fn back_off(&mut self) {
        self.timeout = back_off(self.timeout);
    }

    /// The time-out doubled `doublings` times, at most [`MAX`].
    pub(super) fn timeout_doubled(&self, doublings: u32) -> u64 {
        (self.timeout << doublings.min(8)).min(MAX)
    }

    pub(super) const fn timeout(&self) -> u64 {
        self.timeout
    }

    pub(super) fn smoothed(&self) -> Option<Microseconds> {
        self.smoothed.map(Microseconds)
    }
}

fn back_off(timeout: u64) -> u64 {
    (2 * timeout).min(MAX)
}

/// Times at which to repeat a request whose round trip is not measured: intervals that double from [`START`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Repeat {
    due: Microseconds,
    interval: u64,
}

impl Repeat {
    /// Due at once.
    pub(super) const fn new() -> Self {
        Self { due: Microseconds(0), interval: START }
    }

    pub(super) const fn due(&self) -> Microseconds {
        self.due
    }

    /// Notes that the request was sent at `now`.
    pub(super) fn sent(&mut self, now: Microseconds) {
        self.due = Microseconds(now.0.saturating_add(self.interval));
        self.interval = back_off(self.interval);
    }
}
