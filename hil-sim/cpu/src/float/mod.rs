//! IEEE 754 single precision as FPv4-SP does it (ARM DDI 0403E, A2.5), bit for bit on every host.
//!
//! A finite number is unpacked to a sign, an exponent and a 64-bit significand, computed on exactly or with a sticky
//! last bit, and rounded once. Where the host's arithmetic must give the same result, it is used.

mod arithmetic;
mod convert;
mod round;

pub(crate) use convert::Integer;

/// Sign bit of a single.
pub(crate) const SIGN: u32 = 1 << 31;
const INFINITY: u32 = 0x7f80_0000;
const DEFAULT_NAN: u32 = 0x7fc0_0000;
const QUIET: u32 = 1 << 22;
const FRACTION_BITS: u32 = 23;
const EXPONENT_BIAS: i32 = 127;

/// Cumulative exception bits of FPSCR.
const INVALID: u32 = 1;
const DIVIDE_BY_ZERO: u32 = 1 << 1;
const OVERFLOW: u32 = 1 << 2;
const UNDERFLOW: u32 = 1 << 3;
const INEXACT: u32 = 1 << 4;
const INPUT_DENORMAL: u32 = 1 << 7;
/// Modes of FPSCR.
const FLUSH_TO_ZERO: u32 = 1 << 24;
const USE_DEFAULT_NAN: u32 = 1 << 25;
const ALTERNATIVE_HALF: u32 = 1 << 26;

/// Rounding modes, as FPSCR.RMode encodes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    Nearest,
    TowardPlus,
    TowardMinus,
    TowardZero,
}

/// FPSCR while an operation runs: its modes, and the exceptions so far.
pub(crate) struct Environment {
    fpscr: u32,
}

impl Environment {
    pub fn new(fpscr: u32) -> Self {
        Self { fpscr }
    }

    pub fn fpscr(&self) -> u32 {
        self.fpscr
    }

    pub fn rounding(&self) -> Rounding {
        match self.fpscr >> 22 & 3 {
            0 => Rounding::Nearest,
            1 => Rounding::TowardPlus,
            2 => Rounding::TowardMinus,
            _ => Rounding::TowardZero,
        }
    }

    fn raise(&mut self, exceptions: u32) {
        self.fpscr |= exceptions;
    }

    fn has(&self, mode: u32) -> bool {
        self.fpscr & mode != 0
    }
}

/// An unpacked number. A finite value is `significand * 2^exponent`, with the significand's top bit at bit 62.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unpacked {
    Nan { bits: u32 },
    Infinity { negative: bool },
    Zero { negative: bool },
    Finite { negative: bool, exponent: i32, significand: u64 },
}

impl Environment {
    /// FPUnpack() (A2.5.5): denormals are zero in flush-to-zero mode.
    fn unpack(&mut self, bits: u32) -> Unpacked {
        let negative = bits & SIGN != 0;
        let exponent = bits >> FRACTION_BITS & 0xff;
        let fraction = bits & ((1 << FRACTION_BITS) - 1);
        match (exponent, fraction) {
            (0xff, 0) => Unpacked::Infinity { negative },
            (0xff, _) => Unpacked::Nan { bits },
            (0, 0) => Unpacked::Zero { negative },
            (0, _) if self.has(FLUSH_TO_ZERO) => {
                self.raise(INPUT_DENORMAL);
                Unpacked::Zero { negative }
            }
            (0, _) => normalized(negative, 1 - EXPONENT_BIAS - FRACTION_BITS as i32, u64::from(fraction)),
            _ => normalized(
                negative,
                exponent as i32 - EXPONENT_BIAS - FRACTION_BITS as i32,
                u64::from(fraction | 1 << FRACTION_BITS),
            ),
        }
    }

    /// FPProcessNaNs() (A2.5.6): the first signalling NaN, else the first quiet one, made quiet.
    fn propagate_nan(&mut self, operands: &[u32]) -> Option<u32> {
        let is_nan = |bits: &&u32| **bits & !SIGN > INFINITY;
        let signalling = operands.iter().filter(is_nan).find(|&bits| bits & QUIET == 0);
        if signalling.is_some() {
            self.raise(INVALID);
        }
        let nan = signalling.or_else(|| operands.iter().find(is_nan))?;
        Some(if self.has(USE_DEFAULT_NAN) { DEFAULT_NAN } else { nan | QUIET })
    }

    /// The host's result, where it is all there is to know. Host arithmetic on singles is IEEE 754 with rounding to
    /// nearest (Rust guarantees it on every host except 32-bit x86 without SSE2); a normal result above the smallest
    /// can raise nothing but "inexact". So with that mode and that bit already set (it stays set for the life of most
    /// programs) nothing is left to compute. NaNs, infinities, zeros and tiny numbers are computed bit by bit.
    #[inline(always)]
    fn quick(&self, result: f32) -> Option<u32> {
        const MODES: u32 = 7 << 22;
        const SMALLEST_NORMAL: u32 = 0x0080_0000;
        let magnitude = result.to_bits() & !SIGN;
        let usual = self.fpscr & (MODES | INEXACT) == INEXACT;
        (usual && magnitude > SMALLEST_NORMAL && magnitude < INFINITY).then_some(result.to_bits())
    }

    fn invalid(&mut self) -> u32 {
        self.raise(INVALID);
        DEFAULT_NAN
    }
}

/// A finite value with its top bit moved to bit 62.
fn normalized(negative: bool, exponent: i32, significand: u64) -> Unpacked {
    let shift = significand.leading_zeros() as i32 - 1;
    Unpacked::Finite { negative, exponent: exponent - shift, significand: significand << shift }
}

const fn signed(negative: bool, bits: u32) -> u32 {
    if negative { bits | SIGN } else { bits }
}
