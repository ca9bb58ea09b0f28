//! A device on a serial port, which receives bytes and answers in its own time.

use crate::time::Picoseconds;
use crate::uart::{Frame, SentByte};
use crate::unit::UartId;
use crate::world::{Instant, Terminals, World};

/// A device on a serial line, such as the servos on a bus. It is a state machine: no thread, no clock of its own. Clone
/// it for a snapshot. Put it next to the rest of the world with [`OnPort`]:
///
/// ```
/// use vergence_mcu::{ChipConfig, Frame, LineFault, Machine, Nothing, OnPort, Picoseconds, SentByte, SerialDevice,
/// UartId};
///
/// /// Sends every byte back, at the speed at which it came.
/// #[derive(Clone, Default)]
/// struct Parrot(Vec<SentByte>);
///
/// impl SerialDevice for Parrot {
///     fn receive(&mut self, sent: SentByte) {
///         self.0.push(sent);
///     }
///
///     fn next_event(&self) -> Picoseconds {
///         self.0.first().map_or(Picoseconds::NEVER, |sent| sent.at)
///     }
///
///     fn speak(&mut self, _now: Picoseconds) -> Vec<Frame> {
///         let heard = self.0.drain(..);
///         heard.map(|SentByte { byte, baud, .. }| Frame { byte, baud, fault: LineFault::None }).collect()
///     }
/// }
///
/// let bus = OnPort { port: UartId::USART3, device: Parrot::default() };
/// let board = Machine::new(ChipConfig::default(), (Nothing, bus));
/// ```
pub trait SerialDevice: Clone {
    /// The chip has sent a byte. On a bus of one wire devices hear each other as well: that is for the device to model
    /// that stands for all of them.
    fn receive(&mut self, sent: SentByte);

    /// When the device next sends; [`Picoseconds::NEVER`] where it is silent.
    fn next_event(&self) -> Picoseconds {
        Picoseconds::NEVER
    }

    /// The frames that the device begins to send now, one after the other.
    fn speak(&mut self, now: Picoseconds) -> Vec<Frame>;
}

/// A device wired to a port of the chip: a world to be composed with others, `(bench, OnPort { port, device })`.
#[derive(Clone, Copy, Debug)]
pub struct OnPort<D> {
    /// The port of the chip.
    pub port: UartId,
    /// The device.
    pub device: D,
}

impl<D: SerialDevice> World for OnPort<D> {
    fn next_event(&self) -> Picoseconds {
        self.device.next_event()
    }

    fn act(&mut self, now: Instant, terminals: &mut Terminals) {
        for frame in self.device.speak(now.time) {
            terminals.send(self.port, frame);
        }
    }

    fn byte_sent(&mut self, port: UartId, sent: SentByte, _terminals: &mut Terminals) {
        if port == self.port {
            self.device.receive(sent);
        }
    }
}
