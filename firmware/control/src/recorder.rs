//! The flight recorder: keeps the last events, and after a fault those that led to it until the fault is cleared.

use heapless::Deque;
use vergence_protocol::{
    Counts, EVENTS_PER_ANSWER, FaultRecord, Happening, MAX_AXES, Microseconds, RecordedEvent, RecordedEvents,
};

use crate::contact::Contact;
use crate::io::RigIo;
use crate::settings::AxisSettings;

/// Number of events that the ring holds.
const EVENTS: usize = 64;
/// Number of events recorded after a fault: the rest of the ring keeps the events that led to it.
const AFTER_FAULT: usize = EVENTS / 2;

/// A ring of events.
#[derive(Debug, Default)]
pub struct Recorder {
    events: Deque<RecordedEvent, EVENTS>,
    /// Number of events recorded since the board started.
    total: u32,
    /// While a fault is latched: number of events that may still be recorded.
    room: Option<usize>,
    switches: [[Switch; 2]; MAX_AXES],
}

/// A switch: home switch or hard limit switches of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Switch {
    contact: Contact,
    /// Whether it was operated when last recorded; `None` before the first debounced reading.
    operated: Option<bool>,
}

impl Recorder {
    /// Records an event, unless the room after a fault is used up.
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

    /// Records a fault and the encoder counts of every axis; the events that led to it stay until [`Self::release`].
    pub fn record_fault(&mut self, fault: &FaultRecord, counts: &[Counts]) {
        let FaultRecord { code, axis, detail, at, .. } = *fault;
        self.record(at, Happening::Fault { code, axis, detail });
        for (axis, &counts) in (0..).zip(counts) {
            self.record(at, Happening::Encoder { axis, counts });
        }
        self.room = self.room.or(Some(AFTER_FAULT));
    }

    /// Records without limit again: the fault is cleared.
    pub fn release(&mut self) {
        self.room = None;
    }

    /// Reads the switches of these axes and records debounced changes.
    pub fn watch_switches(&mut self, now: Microseconds, axes: &[AxisSettings], io: &impl RigIo) {
        for (axis, AxisSettings { switches, .. }) in (0u8..).zip(axes) {
            let index = usize::from(axis);
            let readings = [switches.is_home(io.home_switch(index)), switches.is_limit(io.hard_limit(index))];
            for (which, reading) in readings.into_iter().enumerate() {
                let Some([home, limit]) = self.switches.get_mut(index) else { continue };
                let switch = if which == 0 { home } else { limit };
                switch.contact.read(reading, Counts(0));
                let operated = switch.contact.is_closed();
                let before = core::mem::replace(&mut switch.operated, operated);
                if let (Some(_), Some(operated)) = (before.filter(|_| before != operated), operated) {
                    self.record(now, Happening::Switch { axis, home: which == 0, operated });
                }
            }
        }
    }

    /// Whether the latest readings of all switches of the first `axes` axes are debounced.
    pub fn switches_rest(&self, axes: usize) -> bool {
        self.switches.iter().take(axes).flatten().all(|switch| switch.contact.is_settled())
    }

    /// The events from number `first` on, or from the oldest one still kept.
    pub fn page(&self, first: u32) -> RecordedEvents {
        let oldest = self.total.wrapping_sub(self.events.len() as u32);
        let first = first.max(oldest);
        let skip = first.wrapping_sub(oldest) as usize;
        let events = self.events.iter().skip(skip).take(EVENTS_PER_ANSWER).copied().collect();
        RecordedEvents { first, total: self.total, events }
    }
}
