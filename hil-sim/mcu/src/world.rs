//! The surroundings of the chip: they observe its pins and bytes, drive its inputs, and send bytes in their own time.

use vergence_cpu::Cycle;

use crate::pin::{Drive, Pin};
use crate::spi::SpiFrame;
use crate::time::Picoseconds;
use crate::uart::{Frame, SentByte};
use crate::unit::{SpiId, UartId};

/// The present instant, for the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instant {
    /// Core cycles since power-on.
    pub cycle: Cycle,
    /// Real time since power-on.
    pub time: Picoseconds,
}

/// A change of level of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinEdge {
    /// The instant.
    pub at: Instant,
    /// The pin.
    pub pin: Pin,
    /// Whether the pin is high now.
    pub high: bool,
}

/// The chip's terminals, which the world drives.
#[derive(Clone, Debug, Default)]
pub struct Terminals {
    pub(crate) drives: Vec<(Pin, Drive)>,
    pub(crate) frames: Vec<(UartId, Frame)>,
}

impl Terminals {
    /// Drives a pin from outside, from now on.
    pub fn drive(&mut self, pin: Pin, drive: Drive) {
        self.drives.push((pin, drive));
    }

    /// Sends a frame to a serial port, after the frames already on their way.
    pub fn send(&mut self, port: UartId, frame: Frame) {
        self.frames.push((port, frame));
    }
}

/// Everything around the chip. Worlds are composed: a bench of mechanics, a servo bus on a serial port
/// ([`crate::OnPort`]). Clone it for a snapshot. Every method has a default that does nothing.
pub trait World: Clone {
    /// Pins whose edges the world observes; asked for again after every reset.
    fn watched(&self) -> Vec<Pin> {
        Vec::new()
    }

    /// When the world next acts by itself.
    fn next_event(&self) -> Picoseconds {
        Picoseconds::NEVER
    }

    /// Acts at the time that it gave.
    fn act(&mut self, _now: Instant, _terminals: &mut Terminals) {}

    /// Takes a change of level of an observed pin.
    fn pin_changed(&mut self, _edge: PinEdge, _terminals: &mut Terminals) {}

    /// Takes a byte that a serial port has sent.
    fn byte_sent(&mut self, _port: UartId, _sent: SentByte, _terminals: &mut Terminals) {}

    /// Takes a frame that an SPI has sent, and returns what a device has sent in it at the same time; `None` where none is
    /// selected.
    fn frame_exchanged(&mut self, _port: SpiId, _frame: SpiFrame) -> Option<u16> {
        None
    }
}

/// An empty world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Nothing;

impl World for Nothing {}

/// Two worlds side by side.
impl<A: World, B: World> World for (A, B) {
    fn watched(&self) -> Vec<Pin> {
        let mut pins = self.0.watched();
        pins.extend(self.1.watched());
        pins
    }

    fn next_event(&self) -> Picoseconds {
        self.0.next_event().min(self.1.next_event())
    }

    fn act(&mut self, now: Instant, terminals: &mut Terminals) {
        if self.0.next_event() <= now.time {
            self.0.act(now, terminals);
        }
        if self.1.next_event() <= now.time {
            self.1.act(now, terminals);
        }
    }

    fn pin_changed(&mut self, edge: PinEdge, terminals: &mut Terminals) {
        self.0.pin_changed(edge, terminals);
        self.1.pin_changed(edge, terminals);
    }

    fn byte_sent(&mut self, port: UartId, sent: SentByte, terminals: &mut Terminals) {
        self.0.byte_sent(port, sent, terminals);
        self.1.byte_sent(port, sent, terminals);
    }

    fn frame_exchanged(&mut self, port: SpiId, frame: SpiFrame) -> Option<u16> {
        let answers = [self.0.frame_exchanged(port, frame), self.1.frame_exchanged(port, frame)];
        answers.into_iter().flatten().next()
    }
}
