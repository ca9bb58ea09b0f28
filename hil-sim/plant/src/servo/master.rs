//! A master at the other end of the wire: sends a packet and hears what comes back.

use super::bus::{Mechanism, ServoBus};
use super::line::{Nanoseconds, WireByte};

/// A master that sends whole packets, such as a computer's adapter or a board without a chip.
#[derive(Clone, Copy, Debug)]
pub struct Master {
    /// Speed of its port in bits per second.
    pub baud: u32,
    /// Whether it hears its own bytes, as on a single wire.
    pub echoes: bool,
    /// Its clock: the end of what it last sent or heard.
    pub now: Nanoseconds,
}

impl Master {
    /// A master at the beginning of time.
    #[must_use]
    pub const fn new(baud: u32) -> Self {
        Self { baud, echoes: false, now: Nanoseconds(0) }
    }

    /// Sends `bytes` now and listens until the line has been quiet for `wait`. The bytes heard, as they were
    /// sent; those at another speed or damaged are garbled.
    pub fn ask<M: Mechanism>(&mut self, bus: &mut ServoBus<M>, bytes: &[u8], wait: Nanoseconds) -> Vec<u8> {
        let mut heard = Vec::new();
        for &byte in bytes {
            self.now = self.now.plus(Nanoseconds::of_bytes(1, self.baud));
            bus.receive(self.now, byte, self.baud);
            if self.echoes {
                heard.push(byte);
            }
        }
        heard.extend(self.listen(bus, wait));
        heard
    }

    /// Listens until the line has been quiet for `wait`.
    pub fn listen<M: Mechanism>(&mut self, bus: &mut ServoBus<M>, wait: Nanoseconds) -> Vec<u8> {
        let mut heard = Vec::new();
        let mut end = self.now.plus(wait);
        while let Some(at) = bus.next_event().filter(|at| *at <= end) {
            let Some(byte) = bus.speak(at) else { continue };
            let over = at.plus(Nanoseconds::of_bytes(1, byte.baud));
            end = end.max(over.plus(wait));
            heard.push(self.sampled(byte));
        }
        bus.advance(end);
        self.now = end;
        heard
    }

    /// What the port makes of a byte: garbage at another speed.
    fn sampled(&self, byte: WireByte) -> u8 {
        let same = byte.baud == self.baud && !byte.is_damaged;
        if same { byte.byte } else { byte.byte.rotate_left(3) ^ 0xA5 }
    }
}
