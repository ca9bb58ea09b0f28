//! Oscillators and the PLL: where they are switched on, and how long they take.

use super::{BDCR, CR, CRRCR, CSR};
use crate::time::Picoseconds;

/// Clock sources; each is ready after the longest start-up time of the datasheet (DS12288, clock source
/// characteristics).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Hsi16,
    Hse,
    Pll,
    Lse,
    Lsi,
    Hsi48,
}

pub(super) const SOURCES: [Source; 6] =
    [Source::Hsi16, Source::Hse, Source::Pll, Source::Lse, Source::Lsi, Source::Hsi48];

impl Source {
    pub fn start_up(self) -> Picoseconds {
        match self {
            Self::Hsi16 => Picoseconds::nanoseconds(1_200),
            Self::Hse => Picoseconds::milliseconds(2),
            Self::Pll => Picoseconds::microseconds(40),
            Self::Lse => Picoseconds::milliseconds(2_000),
            Self::Lsi => Picoseconds::microseconds(130),
            Self::Hsi48 => Picoseconds::microseconds(6),
        }
    }

    /// The register and bit that switch the source on, and its bit in CIER and CIFR.
    pub fn bits(self) -> (u32, u32, u32) {
        match self {
            Self::Hsi16 => (CR, 8, 3),
            Self::Hse => (CR, 16, 4),
            Self::Pll => (CR, 24, 5),
            Self::Lse => (BDCR, 0, 1),
            Self::Lsi => (CSR, 0, 0),
            Self::Hsi48 => (CRRCR, 0, 10),
        }
    }

    /// HSIRDY is two bits above HSION, the others follow their switch at once.
    pub fn ready_bit(self) -> u32 {
        let (_, on, _) = self.bits();
        if self == Self::Hsi16 { on + 2 } else { on + 1 }
    }
}
