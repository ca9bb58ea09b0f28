//! Multiplications, divisions and the saturating additions.

use super::Trap;
use super::alu::signed_halves;
use crate::cpu::Cpu;
use crate::instruction::{Flags, Instruction, Multiply};
use crate::system::configuration;

/// Rounds SMMUL and similar instructions to nearest.
const HALF_OF_LOW_WORD: i64 = 1 << 31;

impl Cpu {
    #[inline(always)]
    pub(super) fn multiply(&mut self, kind: Multiply, i: &Instruction) -> Result<(), Trap> {
        let (n, m) = (self.read(i.n), self.read(i.m));
        match kind {
            Multiply::Low => {
                let result = n.wrapping_mul(m);
                self.write(i.d, result);
                if i.flags.has(Flags::SET) {
                    self.set_sign_flags(result);
                }
            }
            Multiply::Accumulate => self.write(i.d, self.read(i.a).wrapping_add(n.wrapping_mul(m))),
            Multiply::Subtract => self.write(i.d, self.read(i.a).wrapping_sub(n.wrapping_mul(m))),
            Multiply::UnsignedLong => self.write_long(i, u64::from(n) * u64::from(m)),
            Multiply::SignedLong => self.write_long(i, product(n, m) as u64),
            Multiply::SignedDivide | Multiply::UnsignedDivide => return self.divide(kind, i, n, m),
            _ => self.multiply_rare(kind, i, n, m),
        }
        Ok(())
    }

    /// A division ends early: two cycles and one for every few quotient bits, at most twelve (TRM 3.3.1).
    #[inline(never)]
    fn divide(&mut self, kind: Multiply, i: &Instruction, n: u32, m: u32) -> Result<(), Trap> {
        if m == 0 && self.system.configuration & configuration::TRAP_DIVIDE != 0 {
            return Err(Trap::DivideByZero);
        }
        let (quotient, dividend, divisor) = if kind == Multiply::SignedDivide {
            let quotient = (n as i32).checked_div(m as i32);
            let overflow = if m == 0 { 0 } else { n };
            (
                quotient.map_or(overflow, |quotient| quotient as u32),
                (n as i32).unsigned_abs(),
                (m as i32).unsigned_abs(),
            )
        } else {
            (n.checked_div(m).unwrap_or(0), n, m)
        };
        let bits = (divisor | 1).leading_zeros().saturating_sub((dividend | 1).leading_zeros());
        self.now += 1 + u64::from(bits.div_ceil(3).min(10));
        self.write(i.d, quotient);
        Ok(())
    }

    #[inline(always)]
    fn write_long(&mut self, i: &Instruction, value: u64) {
        self.write(i.d, value as u32);
        self.write(i.a, (value >> 32) as u32);
    }

    /// The accumulator of the long forms.
    fn read_long(&self, i: &Instruction) -> u64 {
        u64::from(self.read(i.a)) << 32 | u64::from(self.read(i.d))
    }

    #[inline(never)]
    fn multiply_rare(&mut self, kind: Multiply, i: &Instruction, n: u32, m: u32) {
        let a = i64::from(self.read(i.a) as i32);
        let half = |word: u32, top: bool| if top { signed_halves(word).1 } else { signed_halves(word).0 };
        let (top_n, top_m) = (i.immediate & 2 != 0, i.immediate & 1 != 0);
        let variant = i.flags.has(Flags::VARIANT);
        let (n0, n1) = signed_halves(n);
        let (m0, m1) = signed_halves(if variant { m.rotate_left(16) } else { m });
        let rounding = if variant { HALF_OF_LOW_WORD } else { 0 };
        match kind {
            Multiply::SignedLongAccumulate => {
                self.write_long(i, self.read_long(i).wrapping_add(product(n, m) as u64));
            }
            Multiply::UnsignedLongAccumulate => {
                self.write_long(i, self.read_long(i).wrapping_add(u64::from(n) * u64::from(m)));
            }
            Multiply::UnsignedLongAccumulateAccumulate => {
                // (2^32 - 1)^2 + 2 (2^32 - 1) is 2^64 - 1: it cannot overflow.
                let sum = u64::from(n) * u64::from(m) + u64::from(self.read(i.a)) + u64::from(self.read(i.d));
                self.write_long(i, sum);
            }
            Multiply::Halves => self.write(i.d, (half(n, top_n) * half(m, top_m)) as u32),
            Multiply::HalvesAccumulate => self.accumulate(i, half(n, top_n) * half(m, top_m) + a),
            Multiply::HalvesLongAccumulate => {
                self.write_long(i, self.read_long(i).wrapping_add((half(n, top_n) * half(m, top_m)) as u64));
            }
            Multiply::WordHalf => self.write(i.d, ((i64::from(n as i32) * half(m, top_m)) >> 16) as u32),
            Multiply::WordHalfAccumulate => self.accumulate(i, ((i64::from(n as i32) * half(m, top_m)) >> 16) + a),
            Multiply::MostSignificant => self.write(i.d, (product(n, m).wrapping_add(rounding) >> 32) as u32),
            Multiply::MostSignificantAccumulate => {
                let sum = (a << 32).wrapping_add(product(n, m)).wrapping_add(rounding);
                self.write(i.d, (sum >> 32) as u32);
            }
            Multiply::MostSignificantSubtract => {
                let difference = (a << 32).wrapping_sub(product(n, m)).wrapping_add(rounding);
                self.write(i.d, (difference >> 32) as u32);
            }
            Multiply::DualAdd => self.accumulate(i, n0 * m0 + n1 * m1),
            Multiply::DualAddAccumulate => self.accumulate(i, n0 * m0 + n1 * m1 + a),
            Multiply::DualSubtract => self.accumulate(i, n0 * m0 - n1 * m1),
            Multiply::DualSubtractAccumulate => self.accumulate(i, n0 * m0 - n1 * m1 + a),
            Multiply::DualAddLong => {
                self.write_long(i, self.read_long(i).wrapping_add((n0 * m0 + n1 * m1) as u64));
            }
            Multiply::DualSubtractLong => {
                self.write_long(i, self.read_long(i).wrapping_add((n0 * m0 - n1 * m1) as u64));
            }
            Multiply::AbsoluteDifferences => self.write(i.d, absolute_differences(n, m)),
            Multiply::AbsoluteDifferencesAccumulate => {
                self.write(i.d, self.read(i.a).wrapping_add(absolute_differences(n, m)));
            }
            _ => self.saturating_add(kind, i, n, m),
        }
    }

    /// A word that does not fit sets Q and wraps.
    fn accumulate(&mut self, i: &Instruction, sum: i64) {
        self.q |= i64::from(sum as i32) != sum;
        self.write(i.d, sum as u32);
    }

    fn saturating_add(&mut self, kind: Multiply, i: &Instruction, n: u32, m: u32) {
        let (n, m) = (i64::from(n as i32), i64::from(m as i32));
        let doubled = matches!(kind, Multiply::SaturatingDoubleAdd | Multiply::SaturatingDoubleSubtract);
        let n = if doubled { i64::from(self.saturate_signed(2 * n, 32) as i32) } else { n };
        let add = matches!(kind, Multiply::SaturatingAdd | Multiply::SaturatingDoubleAdd);
        let result = self.saturate_signed(if add { m + n } else { m - n }, 32);
        self.write(i.d, result);
    }
}

fn product(n: u32, m: u32) -> i64 {
    i64::from(n as i32) * i64::from(m as i32)
}

fn absolute_differences(n: u32, m: u32) -> u32 {
    n.to_le_bytes().iter().zip(m.to_le_bytes()).map(|(&n, m)| u32::from(n.abs_diff(m))).sum()
}
