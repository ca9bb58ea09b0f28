//! The host's unanswered requests: sent in order, repeated until answered.

use heapless::Vec;

use super::round_trip::RoundTrip;
use crate::receiver::increment;
use crate::{Microseconds, Request};

/// Largest number of requests from the oldest unanswered one to the newest. The board remembers more answers than this,
/// so that it can repeat every answer that the host may still ask for.
pub const WINDOW: usize = 4;

#[derive(Debug)]
struct Pending {
    number: u32,
    request: Request,
    sent_at: Microseconds,
    transmissions: u32,
    due: bool,
    acknowledged: bool,
}

impl Pending {
    const fn seq(&self) -> u8 {
        sequence(self.number)
    }

    /// Whether the cumulative acknowledgement `ack` covers this request.
    const fn covered_by(&self, ack: u8) -> bool {
        ack.wrapping_sub(self.seq()) < 1 << 7
    }

    /// Time at which the request is sent again. An acknowledged request may just take long to answer: its repetitions
    /// become ever rarer.
    fn deadline(&self, round_trip: &RoundTrip) -> Microseconds {
        let doublings = if self.acknowledged { self.transmissions.saturating_sub(1) } else { 0 };
        Microseconds(self.sent_at.0.saturating_add(round_trip.timeout_doubled(doublings)))
    }
}

/// The sequence number of request `number` on the wire: its low byte.
pub(super) const fn sequence(number: u32) -> u8 {
    number as u8
}

#[derive(Debug)]
pub(super) struct Window {
    pending: Vec<Pending, WINDOW>,
    next: u32,
    round_trip: RoundTrip,
    retransmitted: u32,
}

impl Window {
    pub(super) const fn new() -> Self {
        Self { pending: Vec::new(), next: 0, round_trip: RoundTrip::new(), retransmitted: 0 }
    }

    /// Takes a request and returns its number; `None` if the window is full.
    pub(super) fn submit(&mut self, now: Microseconds, request: Request) -> Option<u32> {
        let number = self.next;
        let span = self.pending.first().map_or(0, |oldest| number.wrapping_sub(oldest.number));
        if span as usize >= WINDOW {
            return None;
        }
        let pending = Pending { number, request, sent_at: now, transmissions: 0, due: true, acknowledged: false };
        self.pending.push(pending).ok()?;
        self.next = number.wrapping_add(1);
        Some(number)
    }

    /// The next request to send, in order: a new one or one that has timed out.
    pub(super) fn transmit(&mut self, now: Microseconds) -> Option<(u8, Request)> {
        self.time_out(now);
        let pending = self.pending.iter_mut().find(|pending| pending.due)?;
        if pending.transmissions > 0 {
            increment(&mut self.retransmitted);
        }
        increment(&mut pending.transmissions);
        pending.due = false;
        pending.sent_at = now;
        Some((pending.seq(), pending.request.clone()))
    }

    /// Notes that the board has all requests up to `ack`.
    pub(super) fn acknowledge(&mut self, now: Microseconds, ack: u8) {
        for pending in self.pending.iter_mut().filter(|pending| pending.covered_by(ack) && !pending.acknowledged) {
            pending.acknowledged = true;
            if pending.transmissions == 1 {
                self.round_trip.sample(now.0.saturating_sub(pending.sent_at.0));
            }
        }
    }

    /// Makes the requests after `ack` due, which the board misses. Each request behind a gap brings one such message; only
    /// the first of them acts.
    pub(super) fn not_acknowledged(&mut self, now: Microseconds, ack: u8) {
        let patience = self.round_trip.smoothed().map_or(self.round_trip.timeout(), |smoothed| smoothed.0);
        let mut missing = self.pending.iter_mut().skip_while(|pending| pending.covered_by(ack)).peekable();
        let repeats = missing.peek().is_some_and(|first| {
            first.transmissions == 1 || now.0.saturating_sub(first.sent_at.0) >= patience && first.transmissions > 1
        });
        if repeats {
            missing.for_each(|pending| pending.due = true);
        }
    }

    /// Removes the request with sequence number `seq`, which was answered; returns its number, if it was still awaited.
    pub(super) fn answer(&mut self, seq: u8) -> Option<u32> {
        let index = self.pending.iter().position(|pending| pending.seq() == seq && pending.transmissions > 0)?;
        Some(self.pending.remove(index).number)
    }

    /// Time at which [`Self::transmit`] next has a request.
    pub(super) fn wake(&self) -> Option<Microseconds> {
        let wake = |pending: &Pending| if pending.due { Microseconds(0) } else { pending.deadline(&self.round_trip) };
        self.pending.iter().map(wake).min()
    }

    /// Number of requests without an answer.
    pub(super) fn len(&self) -> usize {
        self.pending.len()
    }

    pub(super) fn clear(&mut self) {
        self.pending.clear();
    }

    pub(super) const fn retransmitted(&self) -> u32 {
        self.retransmitted
    }

    pub(super) const fn round_trip(&self) -> &RoundTrip {
        &self.round_trip
    }

    /// Makes requests due that waited too long. The board takes no request behind a gap, so if a request may be lost, all
    /// that follow it are sent again too (go-back-N); if it arrived, only its answer is missing.
    fn time_out(&mut self, now: Microseconds) {
        let mut lost = false;
        for pending in self.pending.iter_mut().filter(|pending| !pending.due) {
            pending.due = pending.deadline(&self.round_trip) <= now;
            lost |= pending.due && !pending.acknowledged;
        }
        if lost {
            self.pending.iter_mut().filter(|pending| !pending.acknowledged).for_each(|pending| pending.due = true);
            self.round_trip.back_off();
        }
    }
}
