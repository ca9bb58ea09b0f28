//! FPRound() (A2.5.9): from an exact significand to the nearest number of a format.

use super::{Environment, FLUSH_TO_ZERO, INEXACT, OVERFLOW, Rounding, UNDERFLOW};

/// A binary floating-point format.
#[derive(Clone, Copy)]
pub(super) struct Format {
    pub fraction_bits: u32,
    pub bias: i32,
    /// Exponent field of infinity.
    pub infinity: u32,
    pub flushes: bool,
}

pub(super) const SINGLE: Format = Format { fraction_bits: 23, bias: 127, infinity: 255, flushes: true };
pub(super) const HALF: Format = Format { fraction_bits: 10, bias: 15, infinity: 31, flushes: false };

/// Whether a magnitude with this remainder (in units of the last place, as a fraction of `1 << bits`) rounds up.
pub(super) fn rounds_up(rounding: Rounding, negative: bool, odd: bool, remainder: u64, bits: u32) -> bool {
    let half = 1_u64 << (bits - 1);
    match rounding {
        Rounding::Nearest => remainder > half || remainder == half && odd,
        Rounding::TowardPlus => !negative && remainder != 0,
        Rounding::TowardMinus => negative && remainder != 0,
        Rounding::TowardZero => false,
    }
}

/// Shifts right and keeps what falls off as a sticky last bit.
pub(super) fn shift_sticky(value: u64, amount: u32) -> u64 {
    match amount {
        0 => value,
        1..=63 => value >> amount | u64::from(value << (64 - amount) != 0),
        _ => u64::from(value != 0),
    }
}

impl Environment {
    /// Magnitude of `significand * 2^exponent`, top bit at bit 62, in a format; the sign decides directed rounding.
    /// Tininess is detected before rounding; an underflow is raised only with an inexact result.
    pub(super) fn round(
        &mut self,
        negative: bool,
        exponent: i32,
        significand: u64,
        format: Format,
        rounding: Rounding,
    ) -> u32 {
        let discarded = 62 - format.fraction_bits;
        // The exponent field of the number as if its range were unlimited.
        let field = exponent + 62 + format.bias;
        let tiny = field < 1;
        if tiny && format.flushes && self.has(FLUSH_TO_ZERO) {
            self.raise(UNDERFLOW);
            return 0;
        }
        let significand = if tiny { shift_sticky(significand, (1 - field) as u32) } else { significand };
        let remainder = significand & ((1 << discarded) - 1);
        let truncated = (significand >> discarded) as u32;
        let rounded = truncated + u32::from(rounds_up(rounding, negative, truncated & 1 != 0, remainder, discarded));
        if tiny && remainder != 0 {
            self.raise(UNDERFLOW);
        }
        // The hidden bit of the significand carries into the exponent field.
        let base = if tiny { 0 } else { (field - 1) as u32 };
        let biased = base + (rounded >> format.fraction_bits);
        if biased >= format.infinity {
            return self.overflow(negative, format, rounding);
        }
        if remainder != 0 {
            self.raise(INEXACT);
        }
        (base << format.fraction_bits) + rounded
    }

    fn overflow(&mut self, negative: bool, format: Format, rounding: Rounding) -> u32 {
        self.raise(OVERFLOW | INEXACT);
        let infinity = format.infinity << format.fraction_bits;
        let away = match rounding {
            Rounding::Nearest => true,
            Rounding::TowardPlus => !negative,
            Rounding::TowardMinus => negative,
            Rounding::TowardZero => false,
        };
        if away { infinity } else { infinity - 1 }
    }

    /// A finite single, with its sign.
    pub(super) fn single(&mut self, negative: bool, exponent: i32, significand: u64) -> u32 {
        let rounding = self.rounding();
        super::signed(negative, self.round(negative, exponent, significand, SINGLE, rounding))
    }
}
