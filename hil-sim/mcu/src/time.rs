//! Real time beside core cycles: the two run together at the frequency of the core clock, which firmware changes.

use std::ops::{Add, Sub};

use vergence_cpu::{Cycle, NEVER};

/// Real time since power-on, in picoseconds; 213 days fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Picoseconds(pub u64);

impl Picoseconds {
    /// An instant that never comes.
    pub const NEVER: Self = Self(u64::MAX);

    /// Whole nanoseconds.
    #[must_use]
    pub const fn nanoseconds(count: u64) -> Self {
        Self(count.saturating_mul(1_000))
    }

    /// Whole microseconds.
    #[must_use]
    pub const fn microseconds(count: u64) -> Self {
        Self(count.saturating_mul(1_000_000))
    }

    /// Whole milliseconds.
    #[must_use]
    pub const fn milliseconds(count: u64) -> Self {
        Self(count.saturating_mul(1_000_000_000))
    }

    /// How long `periods` of a clock of `hz` take, rounded up. Never, where the clock stands.
    #[must_use]
    pub fn periods(periods: u64, hz: u32) -> Self {
        let picoseconds = (u128::from(periods) * PER_SECOND).div_ceil(u128::from(hz.max(1)));
        if hz == 0 { Self::NEVER } else { Self(u64::try_from(picoseconds).unwrap_or(u64::MAX)) }
    }
}

impl Add for Picoseconds {
    type Output = Self;

    /// Saturates at [`Self::NEVER`].
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Picoseconds {
    type Output = Self;

    /// Saturates at zero.
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

const PER_SECOND: u128 = 1_000_000_000_000;

/// The relation between instants and cycles while the core clock keeps its frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeBase {
    cycle: Cycle,
    time: Picoseconds,
    hz: u32,
}

impl TimeBase {
    /// Power-on: cycle zero at time zero, the core clock at `hz`.
    #[must_use]
    pub fn new(hz: u32) -> Self {
        Self { cycle: 0, time: Picoseconds(0), hz: hz.max(1) }
    }

    /// Frequency of the core clock.
    #[must_use]
    pub fn hz(&self) -> u32 {
        self.hz
    }

    /// The instant at which `cycle` begins, rounded down to a picosecond.
    #[must_use]
    pub fn time_of(&self, cycle: Cycle) -> Picoseconds {
        let since = u128::from(cycle.saturating_sub(self.cycle)) * PER_SECOND / u128::from(self.hz);
        self.time + Picoseconds(u64::try_from(since).unwrap_or(u64::MAX))
    }

    /// The first cycle that begins at `time` or later.
    #[must_use]
    pub fn cycle_at(&self, time: Picoseconds) -> Cycle {
        if time == Picoseconds::NEVER {
            return NEVER;
        }
        let since = (u128::from((time - self.time).0) * u128::from(self.hz)).div_ceil(PER_SECOND);
        self.cycle.saturating_add(u64::try_from(since).unwrap_or(NEVER))
    }

    /// Changes the core clock to `hz` from `cycle` on. At most a picosecond is lost.
    pub fn change(&mut self, cycle: Cycle, hz: u32) {
        *self = Self { cycle, time: self.time_of(cycle), hz: hz.max(1) };
    }
}
