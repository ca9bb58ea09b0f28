//! Numbers of servos on a bus.

use thiserror::Error;

/// Whom a packet is for or from: a servo, or all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Id(u8);

/// A number that no servo can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} is not the number of a servo: use 0 to 252")]
pub struct NotAnId(pub u8);

impl Id {
    /// All servos. Combined answers of several servos come from it too.
    pub const BROADCAST: Self = Self(0xFE);
    /// The largest number of a servo.
    pub const MAX: u8 = 252;

    /// The servo of a number, 0 to 252.
    ///
    /// # Errors
    /// [`NotAnId`] for a larger number.
    pub const fn servo(number: u8) -> Result<Self, NotAnId> {
        if number <= Self::MAX { Ok(Self(number)) } else { Err(NotAnId(number)) }
    }

    /// As it stands on the wire: a servo's number or that of all.
    #[must_use]
    pub const fn of_wire(byte: u8) -> Option<Self> {
        if byte <= Self::MAX || byte == Self::BROADCAST.0 { Some(Self(byte)) } else { None }
    }

    /// The byte on the wire.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}
