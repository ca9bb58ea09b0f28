//! The flight recorder: the last things that happened, and what led to a fault until it is cleared.

use heapless::Deque;
use vergence_protocol::{
    Counts, EVENTS_PER_ANSWER, FaultRecord, Happening, MAX_AXES, Microseconds, RecordedEvent, RecordedEvents,
};

use crate::contact::Contact;
use crate::io::RigIo;

/// How many events are kept.
const EVENTS: usize = 64;
/// How many of them may come after a fault: the others are what led to it, and stay.
const AFTER_FAULT: usize = EVENTS / 2;

/// A ring of events.
#[derive(Debug, Default)]
pub struct Recorder {
    events: Deque<RecordedEvent, EVENTS>,
    /// Recorded since start.
    total: u32,
    /// While a fault is latched: how many more may be recorded.
    room: Option<usize>,
    switches: [[Switch; 2]; MAX_AXES],
}

/// A switch as last recorded.
#[derive(Clone, Copy, Debug, Default)]
struct Switch {
    contact: Contact,
    closed: Option<bool>,
}

impl Recorder {
    /// Records that something happened.
    pub fn record(&mut self, at: Microseconds, what: Happening) {
        if self.room == Some(0) {
            return;
        }
        self.room = self.room.map(|room| room - 1);
        if self.events.is_full() {
            self.events.pop_front();
        }
        // There is room now.
        let _ = self.events.push_back(RecordedEvent { at, what });
        self.total = self.total.wrapping_add(1);
    }

    /// Records a fault and where every axis was; what led to it stays until [`Self::release`].
    pub fn record_fault(&mut self, fault: &FaultRecord, counts: &[Counts]) {
        let FaultRecord { code, axis, detail, at, .. } = *fault;
        self.record(at, Happening::Fault { code, axis, detail });
        for (axis, &counts) in (0..).zip(counts) {
            self.record(at, Happening::Encoder { axis, counts });
        }
        self.room = self.room.or(Some(AFTER_FAULT));
    }

    /// The fault is cleared: record on.
    pub fn release(&mut self) {
        self.room = None;
    }

    /// Reads all switches and records which changed for good.
    pub fn watch_switches(&mut self, now: Microseconds, axes: usize, io: &impl RigIo) {
        for (axis, index) in (0u8..).zip(0..axes.min(MAX_AXES)) {
            let readings = [io.home_switch(index), io.hard_limit(index)];
            for (which, reading) in readings.into_iter().enumerate() {
                let switch = &mut self.switches[index][which];
                switch.contact.read(reading, Counts(0));
                let closed = switch.contact.is_closed();
                let before = core::mem::replace(&mut switch.closed, closed);
                if let (Some(_), Some(closed)) = (before.filter(|_| before != closed), closed) {
                    self.record(now, Happening::Switch { axis, home: which == 0, closed });
                }
            }
        }
    }

    /// Whether every switch of the first `axes` reads what was last recorded of it.
    pub fn switches_rest(&self, axes: usize) -> bool {
        self.switches.iter().take(axes).flatten().all(|switch| switch.contact.is_settled())
    }

    /// Events from number `first` on, or from the oldest that is still there.
    pub fn page(&self, first: u32) -> RecordedEvents {
        let oldest = self.total.wrapping_sub(self.events.len() as u32);
        let first = first.max(oldest);
        let skip = first.wrapping_sub(oldest) as usize;
        let events = self.events.iter().skip(skip).take(EVENTS_PER_ANSWER).copied().collect();
        RecordedEvents { first, total: self.total, events }
    }
}
