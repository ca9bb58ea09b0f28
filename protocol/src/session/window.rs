//! The host's requests that are not answered yet: sent in order, repeated until answered.

use heapless::Vec;

use super::round_trip::RoundTrip;
use crate::receiver::increment;
use crate::{Microseconds, Request};

/// How far the newest request may be ahead of the oldest unanswered one. The board remembers more results than this, so
/// that it can answer again whatever the host can still ask again.
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

    /// Whether a cumulative acknowledgement covers it.
    const fn covered_by(&self, ack: u8) -> bool {
        ack.wrapping_sub(self.seq()) < 1 << 7
    }

    /// When it is sent again. One that the board has may just take long to answer: it is asked for ever more rarely.
    fn deadline(&self, round_trip: &RoundTrip) -> Microseconds {
        let doublings = if self.acknowledged { self.transmissions.saturating_sub(1) } else { 0 };
        Microseconds(self.sent_at.0.saturating_add(round_trip.timeout_doubled(doublings)))
    }
}

/// The number as it travels: its low byte.
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

    /// Takes a request and numbers it; `None` where the window is full.
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

    /// The next request to send: in order, new ones and those that timed out.
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

    /// The board has everything up to `ack`.
    pub(super) fn acknowledge(&mut self, now: Microseconds, ack: u8) {
        for pending in self.pending.iter_mut().filter(|pending| pending.covered_by(ack) && !pending.acknowledged) {
            pending.acknowledged = true;
            if pending.transmissions == 1 {
                self.round_trip.sample(now.0.saturating_sub(pending.sent_at.0));
            }
        }
    }

    /// The board misses what follows `ack`. The burst behind one gap brings several of these: one is enough.
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

    /// The answer to `seq` came: its number, where it was still awaited.
    pub(super) fn answer(&mut self, seq: u8) -> Option<u32> {
        let index = self.pending.iter().position(|pending| pending.seq() == seq && pending.transmissions > 0)?;
        Some(self.pending.remove(index).number)
    }

    /// When `transmit` next has something.
    pub(super) fn wake(&self) -> Option<Microseconds> {
        let wake = |pending: &Pending| if pending.due { Microseconds(0) } else { pending.deadline(&self.round_trip) };
        self.pending.iter().map(wake).min()
    }

    /// Requests without an answer.
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

    /// Makes due what waited too long. The board takes nothing behind a gap, so where a request may be lost, all that
    /// follow are sent again too (go-back-N); where it arrived, only its answer is missing.
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
