//! Times and bytes on the wire.

/// An instant or a duration, in nanoseconds since the simulation's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Nanoseconds(pub u64);

impl Nanoseconds {
    /// Whole microseconds.
    #[must_use]
    pub const fn microseconds(count: u64) -> Self {
        Self(count.saturating_mul(1_000))
    }

    /// How long `bytes` bytes of ten bits take at `baud` bits per second.
    #[must_use]
    pub const fn of_bytes(bytes: u64, baud: u32) -> Self {
        let baud = if baud == 0 { 1 } else { baud };
        Self(bytes.saturating_mul(10_000_000_000) / baud as u64)
    }

    /// Later by `other`.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

/// A byte that a servo sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireByte {
    /// When its start bit begins.
    pub at: Nanoseconds,
    /// The data bits.
    pub byte: u8,
    /// Speed of the line in bits per second.
    pub baud: u32,
    /// Whether another servo talks at the same time, so that its stop bit may fail.
    pub is_damaged: bool,
}
