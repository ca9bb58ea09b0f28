//! Pins by their names, and the peripheral signals that connect to them.

use std::fmt;

use crate::unit::{SpiId, TimerId, UartId};

/// A pin of ports A to G, such as PA8.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pin(u8);

/// Ports A to G with 16 pins each.
pub(crate) const PINS: usize = 7 * 16;

/// A set of pins, PA0 in bit 0.
pub(crate) type PinSet = u128;

impl Pin {
    /// The pin with a name such as "PA8"; `None` where the chip has no such pin.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let port = name.strip_prefix('P')?.bytes().next()?.checked_sub(b'A')?;
        let number: u8 = name.get(2..)?.parse().ok()?;
        Self::new(port, number)
    }

    /// Pin `number` 0..16 of `port` 0..7 (A..G).
    #[must_use]
    pub const fn new(port: u8, number: u8) -> Option<Self> {
        if port < 7 && number < 16 { Some(Self(port * 16 + number)) } else { None }
    }

    pub(crate) const fn at(index: usize) -> Self {
        Self(if index < PINS { index as u8 } else { 0 })
    }

    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) const fn port(self) -> usize {
        self.0 as usize / 16
    }

    pub(crate) const fn number(self) -> usize {
        self.0 as usize % 16
    }

    pub(crate) const fn set(self) -> PinSet {
        1 << self.0
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "P{}{}", char::from(b'A' + self.0 / 16), self.0 % 16)
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// The driver of a pin from outside the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drive {
    /// Not driven: pull resistors decide.
    #[default]
    Floating,
    /// Ground.
    Low,
    /// The supply.
    High,
}

impl Drive {
    /// A push-pull output at `level`.
    #[must_use]
    pub const fn level(high: bool) -> Self {
        if high { Self::High } else { Self::Low }
    }
}

/// The peripheral signal that an alternate function connects a pin to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// TIMx_CH1 (0) to CH4 (3).
    Channel(TimerId, u8),
    /// TIMx_CH1N (0) to CH4N (3).
    Complement(TimerId, u8),
    /// TIMx_ETR.
    External(TimerId),
    /// A serial port's transmitter.
    Transmit(UartId),
    /// A serial port's receiver.
    Receive(UartId),
    /// A serial port's driver enable or request to send.
    DriverEnable(UartId),
    /// SPIx_SCK.
    SpiClock(SpiId),
    /// SPIx_MISO.
    SpiIn(SpiId),
    /// SPIx_MOSI.
    SpiOut(SpiId),
}
