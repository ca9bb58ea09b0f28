//! Debounces switches: contacts chatter for milliseconds, and long wires catch spikes.

use vergence_protocol::Counts;

/// Number of equal readings in a row after which a contact counts as changed (GRBL debounces its limit switches by 5 to
/// 25 ms). A search for the home switch travels on for this many ticks.
pub const DEBOUNCE_TICKS: u8 = 5;

/// A switch, read once each tick. `closed` means operated: a normally closed limit switch is operated when it opens.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    closed: Option<bool>,
    reading: bool,
    /// Number of equal readings in a row, including the latest.
    run: u8,
    /// Encoder counts at the first closed reading since the contact was last open for certain.
    edge: Option<Counts>,
}

impl Contact {
    /// Takes a reading at encoder position `counts`.
    pub fn read(&mut self, closed: bool, counts: Counts) {
        self.run = if closed == self.reading { self.run.saturating_add(1) } else { 1 };
        self.reading = closed;
        if self.run >= DEBOUNCE_TICKS {
            self.closed = Some(closed);
        }
        if closed {
            // The first closed reading is nearest to the true edge: the following ones are chatter.
            self.edge.get_or_insert(counts);
        } else if self.run >= DEBOUNCE_TICKS {
            self.edge = None;
        }
    }

    /// Whether the contact is closed; `None` before enough equal readings.
    pub fn is_closed(&self) -> Option<bool> {
        self.closed
    }

    /// Whether the latest reading agrees with the debounced state.
    pub fn is_settled(&self) -> bool {
        self.closed == Some(self.reading)
    }

    /// Encoder counts at which the contact closed, once it is closed for certain.
    pub fn edge(&self) -> Option<Counts> {
        self.edge.filter(|_| self.closed == Some(true))
    }
}
