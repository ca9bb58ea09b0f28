//! A switch contact, debounced: contacts chatter for milliseconds, and long wires catch spikes.

use vergence_protocol::Counts;

/// A contact counts as changed after so many equal readings in a row (GRBL debounces its limits by 5 to 25 ms). A search
/// comes to rest later by the way of as many ticks.
pub const DEBOUNCE_TICKS: u8 = 5;

/// What is known of a contact, read once each tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    closed: Option<bool>,
    reading: bool,
    /// Equal readings in a row, the latest with them.
    run: u8,
    /// Where it closed first since it was last open for good.
    edge: Option<Counts>,
}

impl Contact {
    /// Takes a reading at `counts`.
    pub fn read(&mut self, closed: bool, counts: Counts) {
        self.run = if closed == self.reading { self.run.saturating_add(1) } else { 1 };
        self.reading = closed;
        if self.run >= DEBOUNCE_TICKS {
            self.closed = Some(closed);
        }
        if closed {
            // The first touch is nearest to the true edge: what follows is chatter.
            self.edge.get_or_insert(counts);
        } else if self.run >= DEBOUNCE_TICKS {
            self.edge = None;
        }
    }

    /// Whether it is closed; `None` while that is not known yet.
    pub fn is_closed(&self) -> Option<bool> {
        self.closed
    }

    /// Whether the readings are as they have been for long enough.
    pub fn is_settled(&self) -> bool {
        self.closed == Some(self.reading)
    }

    /// Where it closed, once it is closed for good.
    pub fn edge(&self) -> Option<Counts> {
        self.edge.filter(|_| self.closed == Some(true))
    }
}
