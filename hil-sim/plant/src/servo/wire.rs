//! The wire between a board's port and the servos, with the time that each byte takes.

use std::collections::VecDeque;

use super::bus::{Mechanism, ServoBus};
use super::line::Nanoseconds;

/// Bytes under way between a port and the servos. The port does not hear itself.
#[derive(Clone, Debug)]
pub struct Wire {
    /// Speed of the port in bits per second.
    baud: u32,
    /// Bytes that the port sends and the servos have not got, with the end of each.
    sending: VecDeque<(Nanoseconds, u8)>,
    /// Bytes that the port has got, with the end of each.
    heard: VecDeque<(Nanoseconds, u8)>,
}

impl Wire {
    /// A quiet wire at a port of so many bits per second.
    #[must_use]
    pub const fn new(baud: u32) -> Self {
        Self { baud, sending: VecDeque::new(), heard: VecDeque::new() }
    }

    /// Sends bytes from `now` on, after those before.
    pub fn send(&mut self, bytes: &[u8], now: Nanoseconds) {
        let mut end = self.sending.back().map_or(now, |(end, _)| now.max(*end));
        for &byte in bytes {
            end = end.plus(Nanoseconds::of_bytes(1, self.baud));
            self.sending.push_back((end, byte));
        }
    }

    /// Whether the port still sends.
    #[must_use]
    pub fn is_sending(&self) -> bool {
        !self.sending.is_empty()
    }

    /// Lets time pass until `to`: the bytes of both sides in their order, and the mechanics.
    pub fn run<M: Mechanism>(&mut self, servos: &mut ServoBus<M>, to: Nanoseconds) {
        loop {
            let sent = self.sending.front().map(|(end, _)| *end).filter(|end| *end <= to);
            let spoken = servos.next_event().filter(|at| *at <= to);
            match (sent, spoken) {
                (Some(end), spoken) if spoken.is_none_or(|at| end <= at) => {
                    if let Some((end, byte)) = self.sending.pop_front() {
                        servos.receive(end, byte, self.baud);
                    }
                }
                (_, Some(at)) => {
                    if let Some(byte) = servos.speak(at) {
                        let end = at.plus(Nanoseconds::of_bytes(1, byte.baud));
                        let heard = if byte.is_damaged || byte.baud != self.baud { !byte.byte } else { byte.byte };
                        self.heard.push_back((end, heard));
                    }
                }
                _ => break,
            }
        }
        servos.advance(to);
    }

    /// The next byte that the port has got by `now`.
    pub fn take_heard(&mut self, now: Nanoseconds) -> Option<u8> {
        self.heard.pop_front_if(|(end, _)| *end <= now).map(|(_, byte)| byte)
    }
}
