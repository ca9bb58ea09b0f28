//! Parallel additions and subtractions of halves and bytes (A7.7, table A4-8).

use super::alu::signed_halves;
use crate::cpu::Cpu;
use crate::instruction::{Instruction, Lane, Parallel};

impl Lane {
    const fn is_signed(self) -> bool {
        matches!(self, Self::Signed | Self::SignedSaturating | Self::SignedHalving)
    }

    /// A lane's result, and its GE flag where the arithmetic sets one.
    fn finish(self, exact: i64, width: u32, subtraction: bool) -> (u32, Option<bool>) {
        let signed_limit = 1 << (width - 1);
        let limit = 1 << width;
        let (value, ge) = match self {
            Self::Signed => (exact, Some(exact >= 0)),
            Self::Unsigned => (exact, Some(if subtraction { exact >= 0 } else { exact >= limit })),
            Self::SignedHalving | Self::UnsignedHalving => (exact >> 1, None),
            Self::SignedSaturating => (exact.clamp(-signed_limit, signed_limit - 1), None),
            Self::UnsignedSaturating => (exact.clamp(0, limit - 1), None),
        };
        (value as u32 & (limit - 1) as u32, ge)
    }
}

fn halves(word: u32, signed: bool) -> [i64; 2] {
    if signed { signed_halves(word).into() } else { [i64::from(word & 0xffff), i64::from(word >> 16)] }
}

fn bytes(word: u32, signed: bool) -> [i64; 4] {
    word.to_le_bytes().map(|byte| if signed { i64::from(byte as i8) } else { i64::from(byte) })
}

impl Cpu {
    #[inline(never)]
    pub(super) fn parallel(&mut self, operation: Parallel, i: &Instruction) {
        let lane = Lane::unpack(i.immediate);
        let signed = lane.is_signed();
        let (n, m) = (self.read(i.n), self.read(i.m));
        let [n0, n1] = halves(n, signed);
        let [m0, m1] = halves(m, signed);
        let result = match operation {
            Parallel::Add16 => self.two(lane, (n0 + m0, false), (n1 + m1, false)),
            Parallel::Subtract16 => self.two(lane, (n0 - m0, true), (n1 - m1, true)),
            Parallel::AddSubtract => self.two(lane, (n0 - m1, true), (n1 + m0, false)),
            Parallel::SubtractAdd => self.two(lane, (n0 + m1, false), (n1 - m0, true)),
            Parallel::Add8 => self.four(lane, bytes(n, signed), bytes(m, signed), 1),
            Parallel::Subtract8 => self.four(lane, bytes(n, signed), bytes(m, signed), -1),
        };
        self.write(i.d, result);
    }

    fn two(&mut self, lane: Lane, low: (i64, bool), high: (i64, bool)) -> u32 {
        let (low, low_ge) = lane.finish(low.0, 16, low.1);
        let (high, high_ge) = lane.finish(high.0, 16, high.1);
        if let (Some(low), Some(high)) = (low_ge, high_ge) {
            self.ge = (u8::from(low) * 0b0011) | (u8::from(high) * 0b1100);
        }
        low | high << 16
    }

    fn four(&mut self, lane: Lane, n: [i64; 4], m: [i64; 4], sign: i64) -> u32 {
        let mut result = 0;
        let mut flags = None;
        for (index, (n, m)) in n.into_iter().zip(m).enumerate() {
            let (value, ge) = lane.finish(n + sign * m, 8, sign < 0);
            result |= value << (8 * index);
            if let Some(ge) = ge {
                flags = Some(flags.unwrap_or(0) | u8::from(ge) << index);
            }
        }
        self.ge = flags.unwrap_or(self.ge);
        result
    }

    /// SEL: bytes of n where GE is set, of m elsewhere.
    pub(super) fn select(&mut self, i: &Instruction) {
        let mask = (0..4).filter(|lane| self.ge >> lane & 1 != 0).fold(0, |mask, lane| mask | 0xff << (8 * lane));
        self.write(i.d, self.read(i.n) & mask | self.read(i.m) & !mask);
    }
}
