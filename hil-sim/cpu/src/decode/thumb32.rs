//! 32-bit instructions: the top-level decoding (A5.3), data processing and branches.

use super::{bit, bits, float, memory, multiply, sign_extend, thumb16};
use crate::instruction::{Alu, Flags, Instruction, Op, Shift};

pub(super) const UNDEFINED: Instruction = Instruction::new(Op::Undefined);

pub(super) fn decode(first: u16, second: u16) -> Instruction {
    let op2 = bits(first, 10, 4);
    match bits(first, 12, 11) {
        1 if op2 & 0x64 == 0 => memory::multiple(first, second),
        1 if op2 & 0x64 == 4 => memory::dual_or_exclusive(first, second),
        1 if op2 & 0x60 == 0x20 => shifted_register(first, second),
        2 if !bit(second, 15) && op2 & 0x20 == 0 => modified_immediate(first, second),
        2 if !bit(second, 15) => plain_immediate(first, second),
        2 => branch_or_control(first, second),
        3 if op2 & 0x71 == 0 => memory::store(first, second),
        3 if op2 & 0x61 == 1 => memory::load(first, second),
        3 if op2 & 0x70 == 0x20 => multiply::register(first, second),
        3 if op2 & 0x78 == 0x30 => multiply::multiply(first, second),
        3 if op2 & 0x78 == 0x38 => multiply::long(first, second),
        1 | 3 if op2 & 0x40 != 0 => float::coprocessor(first, second),
        _ => UNDEFINED,
    }
}

/// Operation of the two-operand data-processing groups (A5.3.1, A5.3.11), with its d, n and flags.
fn operation(first: u16, second: u16) -> Option<(Alu, Instruction)> {
    let (d, n, set) = (bits(second, 11, 8), bits(first, 3, 0), bit(first, 4));
    let test = d == 15 && set;
    let alu = match bits(first, 8, 5) {
        0 if test => Alu::Test,
        0 => Alu::And,
        1 => Alu::BitClear,
        2 if n == 15 => Alu::Move,
        2 => Alu::Or,
        3 if n == 15 => Alu::MoveNot,
        3 => Alu::OrNot,
        4 if test => Alu::TestEqual,
        4 => Alu::ExclusiveOr,
        8 if test => Alu::CompareNegative,
        8 => Alu::Add,
        10 => Alu::AddCarry,
        11 => Alu::SubtractCarry,
        13 if test => Alu::Compare,
        13 => Alu::Subtract,
        14 => Alu::ReverseSubtract,
        _ => return None,
    };
    let writes = !matches!(alu, Alu::Test | Alu::TestEqual | Alu::Compare | Alu::CompareNegative);
    // Writing the PC is unpredictable here; an undefined instruction makes it visible.
    (!writes || d != 15).then(|| (alu, Instruction::new(Op::Nop).d(d).n(n).flags(Flags::SET.when(set))))
}

fn shifted_register(first: u16, second: u16) -> Instruction {
    let shift = Shift::from_immediate(bits(second, 5, 4), bits(second, 14, 12) << 2 | bits(second, 7, 6));
    let m = bits(second, 3, 0);
    if bits(first, 8, 5) == 6 {
        let pack = Instruction::new(Op::PackHalves).d(bits(second, 11, 8)).n(bits(first, 3, 0)).m(m);
        return pack.immediate(shift).flags(Flags::VARIANT.when(bit(second, 5)));
    }
    let Some((alu, mut instruction)) = operation(first, second) else { return UNDEFINED };
    instruction.op = if shift == Shift::Left.pack(0) { Op::AluRegister(alu) } else { Op::AluShifted(alu) };
    instruction.m(m).immediate(shift)
}

fn modified_immediate(first: u16, second: u16) -> Instruction {
    let Some((alu, mut instruction)) = operation(first, second) else { return UNDEFINED };
    let (value, carry) = expand_immediate(immediate12(first, second));
    instruction.op = Op::AluImmediate(alu);
    instruction.immediate(value).flags(Flags::CARRY.when(carry))
}

fn immediate12(first: u16, second: u16) -> u16 {
    bits(first, 10, 10) << 11 | bits(second, 14, 12) << 8 | bits(second, 7, 0)
}

/// ThumbExpandImm_C(): the value, and whether its bit 31 is also the carry (A5.3.2).
fn expand_immediate(immediate: u16) -> (u32, bool) {
    let byte = u32::from(immediate & 0xff);
    match immediate >> 8 {
        0 => (byte, false),
        1 => (byte << 16 | byte, false),
        2 => (byte << 24 | byte << 8, false),
        3 => (byte * 0x0101_0101, false),
        _ => ((0x80 | byte & 0x7f).rotate_right(u32::from(immediate >> 7)), true),
    }
}

fn plain_immediate(first: u16, second: u16) -> Instruction {
    let (d, n) = (bits(second, 11, 8), bits(first, 3, 0));
    let value = u32::from(immediate12(first, second));
    let wide = value | u32::from(n) << 12;
    let low = bits(second, 14, 12) << 2 | bits(second, 7, 6);
    let last = bits(second, 4, 0);
    match bits(first, 8, 4) {
        0 if n == 15 => Instruction::new(Op::Address).d(d).immediate(value),
        0 => Instruction::new(Op::AluImmediate(Alu::Add)).d(d).n(n).immediate(value),
        4 => Instruction::new(Op::AluImmediate(Alu::Move)).d(d).immediate(wide),
        10 if n == 15 => Instruction::new(Op::Address).d(d).immediate(value.wrapping_neg()),
        10 => Instruction::new(Op::AluImmediate(Alu::Subtract)).d(d).n(n).immediate(value),
        12 => Instruction::new(Op::MoveTop).d(d).immediate(wide),
        16 | 18 | 24 | 26 => saturate(first, second, low),
        20 | 28 if low + last < 32 => {
            let op = if bit(first, 7) { Op::UnsignedExtract } else { Op::SignedExtract };
            Instruction::new(op).d(d).n(n).a(last + 1).immediate(u32::from(low))
        }
        22 if last >= low => Instruction::new(Op::BitfieldInsert).d(d).m(n).a(last - low + 1).immediate(u32::from(low)),
        _ => UNDEFINED,
    }
}

/// SSAT, USAT and their 16-bit forms, which take the place of an arithmetic shift by zero.
fn saturate(first: u16, second: u16, amount: u16) -> Instruction {
    let unsigned = bit(first, 7);
    let both = bit(first, 5) && amount == 0;
    let op = match (unsigned, both) {
        (false, false) => Op::SignedSaturate,
        (false, true) => Op::SignedSaturate16,
        (true, false) => Op::UnsignedSaturate,
        (true, true) => Op::UnsignedSaturate16,
    };
    let shift = Shift::from_immediate(if bit(first, 5) { 2 } else { 0 }, amount);
    let width = bits(second, 4, 0) + u16::from(!unsigned);
    Instruction::new(op).d(bits(second, 11, 8)).n(bits(first, 3, 0)).a(width).immediate(shift)
}

fn branch_or_control(first: u16, second: u16) -> Instruction {
    let (sign, j1, j2) = (u32::from(bits(first, 10, 10)), bits(second, 13, 13), bits(second, 11, 11));
    let low = u32::from(bits(second, 10, 0)) << 1;
    if bit(second, 12) {
        let i1 = u32::from(j1) ^ sign ^ 1;
        let i2 = u32::from(j2) ^ sign ^ 1;
        let offset = sign << 24 | i1 << 23 | i2 << 22 | u32::from(bits(first, 9, 0)) << 12 | low;
        let op = if bit(second, 14) { Op::BranchLink } else { Op::Branch };
        return Instruction::new(op).immediate(sign_extend(offset, 25));
    }
    if bit(second, 14) {
        return UNDEFINED;
    }
    if bits(first, 9, 7) != 7 {
        let offset = sign << 20 | u32::from(j2) << 19 | u32::from(j1) << 18 | u32::from(bits(first, 5, 0)) << 12 | low;
        return Instruction::new(Op::BranchIf).d(bits(first, 9, 6)).immediate(sign_extend(offset, 21));
    }
    control(first, second)
}

/// MSR, MRS, hints and barriers (A5.3.4).
fn control(first: u16, second: u16) -> Instruction {
    let special = u32::from(second & 0xff);
    match bits(first, 10, 4) {
        0x38 | 0x39 => {
            Instruction::new(Op::MoveToSpecial).n(bits(first, 3, 0)).a(bits(second, 11, 10)).immediate(special)
        }
        0x3a if bits(second, 10, 8) == 0 => thumb16::hint(if special < 16 { special as u16 } else { 0 }),
        0x3b => match bits(second, 7, 4) {
            2 => Instruction::new(Op::ClearExclusive),
            4..=6 => Instruction::new(Op::Barrier),
            _ => UNDEFINED,
        },
        0x3e | 0x3f => Instruction::new(Op::MoveFromSpecial).d(bits(second, 11, 8)).immediate(special),
        _ => UNDEFINED,
    }
}
