//! A bus of servos on a serial port of the chip.

use vergence_plant::servo::{Mechanism, Nanoseconds, ServoBus};

use crate::serial_device::SerialDevice;
use crate::time::Picoseconds;
use crate::uart::{Frame, LineFault, SentByte};

/// The chip hears its own bytes by itself where its port is set to a single wire.
impl<M: Mechanism> SerialDevice for ServoBus<M> {
    fn receive(&mut self, sent: SentByte) {
        self.receive(nanoseconds(sent.at), sent.byte, sent.baud);
    }

    fn next_event(&self) -> Picoseconds {
        self.next_event().map_or(Picoseconds::NEVER, |at| Picoseconds::nanoseconds(at.0))
    }

    fn speak(&mut self, now: Picoseconds) -> Vec<Frame> {
        let byte = self.speak(nanoseconds(now));
        let frame = byte.map(|byte| Frame {
            byte: byte.byte,
            baud: byte.baud,
            fault: if byte.is_damaged { LineFault::Framing } else { LineFault::None },
        });
        frame.into_iter().collect()
    }
}

/// Rounded up, so that what is due at the end of a nanosecond is due.
fn nanoseconds(time: Picoseconds) -> Nanoseconds {
    Nanoseconds(time.0.div_ceil(1_000))
}
