//! Conversions to and from integers, fixed point and half precision (A2.5.8).

use super::round::{Format, HALF, SINGLE, rounds_up, shift_sticky};
use super::{
    ALTERNATIVE_HALF, DEFAULT_NAN, Environment, FRACTION_BITS, INEXACT, INFINITY, INVALID, OVERFLOW, QUIET, Rounding,
    SIGN, USE_DEFAULT_NAN, Unpacked, signed,
};

const HALF_INFINITY: u16 = 0x7c00;
const HALF_DEFAULT_NAN: u16 = 0x7e00;
const HALF_SIGN: u16 = 0x8000;
const HALF_QUIET: u16 = 0x0200;
/// Bits by which a single's fraction is longer than a half's.
const FRACTION_DIFFERENCE: u32 = 13;

/// The integer a number is converted to.
#[derive(Clone, Copy)]
pub(crate) struct Integer {
    pub bits: u32,
    pub signed: bool,
}

impl Integer {
    fn limits(self) -> (i128, i128) {
        if self.signed { (-(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1) } else { (0, (1 << self.bits) - 1) }
    }
}

impl Environment {
    /// `value / 2^fraction` (FixedToFP).
    pub fn integer_to_single(&mut self, value: i64, fraction: u32, rounding: Rounding) -> u32 {
        if value == 0 {
            return 0;
        }
        let (negative, magnitude) = (value < 0, value.unsigned_abs());
        let shift = magnitude.leading_zeros() - 1;
        let exponent = -(fraction as i32) - shift as i32;
        signed(negative, self.round(negative, exponent, magnitude << shift, SINGLE, rounding))
    }

    /// `x * 2^fraction` as an integer, saturated (FPToFixed); a 16-bit result is extended to the register.
    pub fn single_to_integer(&mut self, x: u32, fraction: u32, integer: Integer, rounding: Rounding) -> u32 {
        let (low, high) = integer.limits();
        let value = match self.unpack(x) {
            Unpacked::Zero { .. } => return 0,
            Unpacked::Nan { .. } => {
                self.raise(INVALID);
                return 0;
            }
            Unpacked::Infinity { negative } => return self.saturated(if negative { low } else { high }),
            Unpacked::Finite { negative, exponent, significand } => {
                let (magnitude, exact) = integral(negative, exponent + fraction as i32, significand, rounding);
                let value = if negative { -magnitude } else { magnitude };
                if value < low || value > high {
                    return self.saturated(value.clamp(low, high));
                }
                if !exact {
                    self.raise(INEXACT);
                }
                value
            }
        };
        value as u32
    }

    fn saturated(&mut self, value: i128) -> u32 {
        self.raise(INVALID);
        value as u32
    }

    pub fn single_to_half(&mut self, x: u32) -> u16 {
        let alternative = self.has(ALTERNATIVE_HALF);
        let negative = x & SIGN != 0;
        let sign = if negative { HALF_SIGN } else { 0 };
        match self.unpack(x) {
            Unpacked::Nan { .. } if alternative => {
                self.raise(INVALID);
                sign
            }
            Unpacked::Nan { bits } => {
                if bits & QUIET == 0 {
                    self.raise(INVALID);
                }
                if self.has(USE_DEFAULT_NAN) {
                    return HALF_DEFAULT_NAN;
                }
                sign | HALF_DEFAULT_NAN | (bits >> FRACTION_DIFFERENCE) as u16 & (HALF_QUIET - 1)
            }
            Unpacked::Infinity { .. } if alternative => {
                self.raise(INVALID);
                sign | 0x7fff
            }
            Unpacked::Infinity { .. } => sign | HALF_INFINITY,
            Unpacked::Zero { .. } => sign,
            Unpacked::Finite { exponent, significand, .. } if alternative => {
                sign | self.alternative_half(negative, exponent, significand)
            }
            Unpacked::Finite { exponent, significand, .. } => {
                let rounding = self.rounding();
                sign | self.round(negative, exponent, significand, HALF, rounding) as u16
            }
        }
    }

    /// The alternative format has numbers where IEEE has infinities; too large is invalid and saturates.
    fn alternative_half(&mut self, negative: bool, exponent: i32, significand: u64) -> u16 {
        let before = self.fpscr;
        self.fpscr &= !OVERFLOW;
        let rounding = self.rounding();
        let bits = self.round(negative, exponent, significand, Format { infinity: 32, ..HALF }, rounding);
        if self.has(OVERFLOW) {
            self.fpscr = before | INVALID;
            return 0x7fff;
        }
        self.fpscr |= before;
        bits as u16
    }

    pub fn half_to_single(&mut self, x: u16) -> u32 {
        let negative = x & HALF_SIGN != 0;
        let exponent = x >> 10 & 0x1f;
        let fraction = u32::from(x & 0x3ff);
        match (exponent, fraction) {
            (0, 0) => signed(negative, 0),
            (31, 0) if !self.has(ALTERNATIVE_HALF) => signed(negative, INFINITY),
            (31, _) if !self.has(ALTERNATIVE_HALF) => {
                if x & HALF_QUIET == 0 {
                    self.raise(INVALID);
                }
                if self.has(USE_DEFAULT_NAN) {
                    DEFAULT_NAN
                } else {
                    signed(negative, DEFAULT_NAN | fraction << FRACTION_DIFFERENCE)
                }
            }
            (0, _) => {
                // A half's denormal is a normal single.
                let shift = fraction.leading_zeros() - 21;
                let field = (113 - shift) << FRACTION_BITS;
                signed(negative, field | (fraction << shift & 0x3ff) << FRACTION_DIFFERENCE)
            }
            _ => signed(negative, (u32::from(exponent) + 112) << FRACTION_BITS | fraction << FRACTION_DIFFERENCE),
        }
    }
}

/// Magnitude rounded to an integer, at most somewhat above 2^33, and whether that is exact.
fn integral(negative: bool, exponent: i32, significand: u64, rounding: Rounding) -> (i128, bool) {
    const FAR_TOO_LARGE: i128 = 1 << 40;
    if exponent >= 0 {
        return (FAR_TOO_LARGE, true);
    }
    // Two bits below the point are enough to round: half, and sticky.
    let fixed = shift_sticky(significand, (-exponent - 2).max(0) as u32);
    let fixed = if exponent == -1 { i128::from(fixed) << 1 } else { i128::from(fixed) };
    let remainder = (fixed & 3) as u64;
    let whole = fixed >> 2;
    let up = rounds_up(rounding, negative, whole & 1 != 0, remainder, 2);
    (whole + i128::from(up), remainder == 0)
}
