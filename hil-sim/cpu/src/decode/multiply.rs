//! Register data processing, parallel arithmetic and multiplications (A5.3.12 to A5.3.17).

use super::thumb32::UNDEFINED;
use super::{bit, bits};
use crate::instruction::{Extend, Flags, Instruction, Lane, Multiply, Op, Parallel, Reverse, Shift};

/// Data processing (register).
pub(super) fn register(first: u16, second: u16) -> Instruction {
    let (d, n, m) = (bits(second, 11, 8), bits(first, 3, 0), bits(second, 3, 0));
    let base = |op| Instruction::new(op).d(d).n(n).m(m);
    if bits(second, 15, 12) != 15 {
        return UNDEFINED;
    }
    if !bit(first, 7) {
        if bits(second, 7, 4) == 0 {
            let kind = [Shift::Left, Shift::Right, Shift::Arithmetic, Shift::Rotate][usize::from(bits(first, 6, 5))];
            return base(Op::ShiftRegister(kind)).flags(Flags::SET.when(bit(first, 4)));
        }
        return extend(first, second);
    }
    if bits(second, 7, 6) == 2 && bits(first, 7, 6) == 2 {
        return miscellaneous(first, second);
    }
    if bit(second, 7) {
        return UNDEFINED;
    }
    let lane = match bits(second, 6, 4) {
        0 => Lane::Signed,
        1 => Lane::SignedSaturating,
        2 => Lane::SignedHalving,
        4 => Lane::Unsigned,
        5 => Lane::UnsignedSaturating,
        6 => Lane::UnsignedHalving,
        _ => return UNDEFINED,
    };
    let operation = match bits(first, 6, 4) {
        0 => Parallel::Add8,
        1 => Parallel::Add16,
        2 => Parallel::AddSubtract,
        4 => Parallel::Subtract8,
        5 => Parallel::Subtract16,
        6 => Parallel::SubtractAdd,
        _ => return UNDEFINED,
    };
    base(Op::Parallel(operation)).immediate(lane as u32)
}

fn extend(first: u16, second: u16) -> Instruction {
    if !bit(second, 7) || bit(second, 6) {
        return UNDEFINED;
    }
    let kind = match bits(first, 6, 4) {
        0 => Extend::SignedHalf,
        1 => Extend::UnsignedHalf,
        2 => Extend::SignedBytes16,
        3 => Extend::UnsignedBytes16,
        4 => Extend::SignedByte,
        5 => Extend::UnsignedByte,
        _ => return UNDEFINED,
    };
    Instruction::new(Op::Extend(kind))
        .d(bits(second, 11, 8))
        .n(bits(first, 3, 0))
        .m(bits(second, 3, 0))
        .immediate(u32::from(bits(second, 5, 4)) << 3)
}

/// Saturating additions, reversals, SEL and CLZ (A5.3.15).
fn miscellaneous(first: u16, second: u16) -> Instruction {
    let op = match (bits(first, 5, 4), bits(second, 5, 4)) {
        (0, 0) => Op::Multiply(Multiply::SaturatingAdd),
        (0, 1) => Op::Multiply(Multiply::SaturatingDoubleAdd),
        (0, 2) => Op::Multiply(Multiply::SaturatingSubtract),
        (0, _) => Op::Multiply(Multiply::SaturatingDoubleSubtract),
        (1, 0) => Op::Reverse(Reverse::Bytes),
        (1, 1) => Op::Reverse(Reverse::BytesInHalves),
        (1, 2) => Op::Reverse(Reverse::Bits),
        (1, _) => Op::Reverse(Reverse::SignedHalf),
        (2, 0) => Op::Select,
        (3, 0) => Op::Reverse(Reverse::LeadingZeros),
        _ => return UNDEFINED,
    };
    Instruction::new(op).d(bits(second, 11, 8)).n(bits(first, 3, 0)).m(bits(second, 3, 0))
}

/// Multiply, multiply accumulate and absolute difference (A5.3.16).
pub(super) fn multiply(first: u16, second: u16) -> Instruction {
    let a = bits(second, 15, 12);
    let plain = a == 15;
    let variant = bit(second, 4);
    let pick = |without, with| if plain { without } else { with };
    let halves = u32::from(bits(second, 5, 4));
    let (kind, immediate, variant) = match (bits(first, 6, 4), bits(second, 5, 4)) {
        (0, 0) => (pick(Multiply::Low, Multiply::Accumulate), 0, false),
        (0, 1) => (Multiply::Subtract, 0, false),
        (1, _) => (pick(Multiply::Halves, Multiply::HalvesAccumulate), halves, false),
        (2, 0 | 1) => (pick(Multiply::DualAdd, Multiply::DualAddAccumulate), 0, variant),
        (3, 0 | 1) => (pick(Multiply::WordHalf, Multiply::WordHalfAccumulate), halves & 1, false),
        (4, 0 | 1) => (pick(Multiply::DualSubtract, Multiply::DualSubtractAccumulate), 0, variant),
        (5, 0 | 1) => (pick(Multiply::MostSignificant, Multiply::MostSignificantAccumulate), 0, variant),
        (6, 0 | 1) => (Multiply::MostSignificantSubtract, 0, variant),
        (7, 0) => (pick(Multiply::AbsoluteDifferences, Multiply::AbsoluteDifferencesAccumulate), 0, false),
        _ => return UNDEFINED,
    };
    if bits(second, 7, 6) != 0 {
        return UNDEFINED;
    }
    operands(kind, first, second).a(a).immediate(immediate).flags(Flags::VARIANT.when(variant))
}

/// Long multiply and divide (A5.3.17): the high word in a, the low one in the field of the accumulator.
pub(super) fn long(first: u16, second: u16) -> Instruction {
    let op2 = bits(second, 7, 4);
    let kind = match (bits(first, 6, 4), op2) {
        (0, 0) => Multiply::SignedLong,
        (1, 15) => return operands(Multiply::SignedDivide, first, second),
        (2, 0) => Multiply::UnsignedLong,
        (3, 15) => return operands(Multiply::UnsignedDivide, first, second),
        (4, 0) => Multiply::SignedLongAccumulate,
        (4, 8..=11) => Multiply::HalvesLongAccumulate,
        (4, 12 | 13) => Multiply::DualAddLong,
        (5, 12 | 13) => Multiply::DualSubtractLong,
        (6, 0) => Multiply::UnsignedLongAccumulate,
        (6, 6) => Multiply::UnsignedLongAccumulateAccumulate,
        _ => return UNDEFINED,
    };
    let variant = op2 >= 12 && op2 & 1 != 0;
    operands(kind, first, second)
        .d(bits(second, 15, 12))
        .a(bits(second, 11, 8))
        .immediate(u32::from(op2 & 3))
        .flags(Flags::VARIANT.when(variant))
}

fn operands(kind: Multiply, first: u16, second: u16) -> Instruction {
    Instruction::new(Op::Multiply(kind)).d(bits(second, 11, 8)).n(bits(first, 3, 0)).m(bits(second, 3, 0))
}
