//! The drivers' serial line: one wire for both directions, one exchange at a time, drivers in turn.

use heapless::Vec;
use vergence_protocol::{AxisList, DriverState, Microseconds};

use super::channel::{Channel, Order, Outcome};
use super::datagram::{Datagram, LONGEST, request, value_of, write};
use super::registers::Register;
use super::settings::DriverSettings;

/// Longest time of an exchange in microseconds. On the line it takes half a millisecond at 250 kbaud; the rest is for
/// boards that are busy.
const PATIENCE_US: u64 = 3_000;
/// Pause between two exchanges while drivers are set or the motors are on, in microseconds: a short circuit is seen before
/// the stage lags far behind.
const BUSY_PAUSE_US: u64 = 400;
/// Pause while the motors are off and all drivers have their settings.
const REST_PAUSE_US: u64 = 25_000;

/// The exchange under way.
#[derive(Clone, Debug)]
struct Exchange {
    axis: usize,
    sent: Datagram,
    /// The register asked for; `None` for a write.
    asked: Option<Register>,
    until: Microseconds,
    /// What the line carried since: the board's own bytes first, for there is one wire.
    heard: Vec<u8, { 2 * LONGEST }>,
}

impl Exchange {
    /// The outcome once it is known.
    fn outcome(&self) -> Option<Outcome> {
        let (echo, reply) = self.heard.split_at_checked(self.sent.len())?;
        match self.asked {
            _ if echo != self.sent => Some(Outcome::Garbage),
            None => Some(Outcome::Value(0)),
            Some(_) if reply.len() < LONGEST => None,
            Some(register) => Some(value_of(reply, register).map_or(Outcome::Garbage, Outcome::Value)),
        }
    }

    /// The outcome when time is up: a driver that is not there leaves the board alone with its own bytes.
    fn late_outcome(&self) -> Outcome {
        if self.heard == self.sent { Outcome::Silence } else { Outcome::Garbage }
    }
}

/// All drivers of a line. Time and bytes are arguments: send what [`Self::poll`] returns, pass on all bytes that the line
/// carries to [`Self::receive`], one's own included, and call [`Self::poll`] again at [`Self::wakes_at`] and after each
/// byte.
#[derive(Clone, Debug, Default)]
pub struct DriverLine {
    channels: AxisList<Channel>,
    motors_on: bool,
    /// The axis whose turn it is.
    turn: usize,
    exchange: Option<Exchange>,
    /// Before this no exchange begins.
    pause_until: Microseconds,
}

impl DriverLine {
    /// Sets the drivers of all axes, in the order of their addresses. A driver whose settings are the same goes on.
    pub fn configure(&mut self, settings: impl IntoIterator<Item = DriverSettings>) {
        for (index, new) in settings.into_iter().enumerate() {
            match self.channels.get_mut(index) {
                Some(channel) if *channel.settings() == new => {}
                Some(channel) => *channel = Channel::new(new),
                // An axis too many is none of the board's.
                None => {
                    let _ = self.channels.push(Channel::new(new));
                }
            }
        }
        self.exchange = None;
        self.pause_until = Microseconds(0);
    }

    /// Notes whether the motors are on: then the drivers are watched closely.
    pub fn set_motors(&mut self, on: bool) {
        if on && !self.motors_on {
            self.pause_until = Microseconds(0);
        }
        self.motors_on = on;
    }

    /// State of the driver of an axis.
    #[must_use]
    pub fn state(&self, axis: usize) -> DriverState {
        self.channels.get(axis).map(Channel::state).unwrap_or_default()
    }

    /// When [`Self::poll`] has something to do; `None` while no axis has a driver on the line.
    #[must_use]
    pub fn wakes_at(&self) -> Option<Microseconds> {
        if let Some(exchange) = &self.exchange {
            return Some(exchange.until);
        }
        self.channels.iter().filter_map(Channel::due).min().map(|due| due.max(self.pause_until))
    }

    /// Takes a byte that the line carried.
    pub fn receive(&mut self, now: Microseconds, byte: u8) {
        let Some(exchange) = &mut self.exchange else { return };
        let _ = exchange.heard.push(byte);
        if let Some(outcome) = exchange.outcome() {
            self.end(now, outcome);
        }
    }

    /// The next datagram for the line, if one is due. Forget bytes received before it is sent.
    pub fn poll(&mut self, now: Microseconds) -> Option<Datagram> {
        if let Some(late) = self.exchange.as_ref().filter(|exchange| exchange.until <= now) {
            let outcome = late.late_outcome();
            self.end(now, outcome);
        }
        if self.exchange.is_some() || now < self.pause_until {
            return None;
        }
        let count = self.channels.len();
        let axis = (0..count).map(|step| (self.turn + step) % count).find(|&axis| self.is_due(axis, now))?;
        let address = u8::try_from(axis).ok()?;
        let (sent, asked) = match self.channels.get(axis)?.order() {
            Order::Read(register) => (request(address, register), Some(register)),
            Order::Write(register, value) => (write(address, register, value), None),
        };
        self.turn = axis + 1;
        let until = Microseconds(now.0 + PATIENCE_US);
        self.exchange = Some(Exchange { axis, sent: sent.clone(), asked, until, heard: Vec::new() });
        Some(sent)
    }

    fn is_due(&self, axis: usize, now: Microseconds) -> bool {
        self.channels.get(axis).and_then(Channel::due).is_some_and(|due| due <= now)
    }

    fn end(&mut self, now: Microseconds, outcome: Outcome) {
        let Some(exchange) = self.exchange.take() else { return };
        if let Some(channel) = self.channels.get_mut(exchange.axis) {
            channel.take(now, outcome);
        }
        let is_calm = !self.motors_on && self.channels.iter().all(Channel::is_calm);
        self.pause_until = Microseconds(now.0 + if is_calm { REST_PAUSE_US } else { BUSY_PAUSE_US });
    }
}
