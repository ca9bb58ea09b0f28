//! Coprocessor space: FPv4-SP (A6); other coprocessors are absent.

use super::thumb32::UNDEFINED;
use super::{bit, bits};
use crate::instruction::{Flags, Float, Instruction, Op};

pub(super) fn coprocessor(first: u16, second: u16) -> Instruction {
    if bits(first, 9, 8) == 3 {
        return UNDEFINED;
    }
    if bits(second, 11, 9) != 5 {
        return Instruction::new(Op::NoCoprocessor);
    }
    let double = bit(second, 8);
    if bit(first, 12) {
        return UNDEFINED;
    }
    match (bits(first, 9, 8), bit(second, 4)) {
        (2, false) if double => UNDEFINED,
        (2, false) => arithmetic(first, second),
        (2, true) => transfer(first, second),
        _ if bits(first, 8, 5) == 2 => transfer_pair(first, second),
        _ => memory(first, second),
    }
}

fn d(first: u16, second: u16) -> u16 {
    bits(second, 15, 12) << 1 | bits(first, 6, 6)
}

fn n(first: u16, second: u16) -> u16 {
    bits(first, 3, 0) << 1 | bits(second, 7, 7)
}

fn m(second: u16) -> u16 {
    bits(second, 3, 0) << 1 | bits(second, 5, 5)
}

/// The first of the two S registers that form D register `high:low`.
fn double(low: u16, high: bool) -> u16 {
    low << 1 | u16::from(high) << 5
}

/// Data processing (A6.4).
fn arithmetic(first: u16, second: u16) -> Instruction {
    let variant = bit(second, 6);
    let pick = |without, with| if variant { with } else { without };
    let float = match (bit(first, 7), bits(first, 5, 4)) {
        (false, 0) => pick(Float::MultiplyAccumulate, Float::MultiplySubtract),
        (false, 1) => pick(Float::NegateMultiplySubtract, Float::NegateMultiplyAccumulate),
        (false, 2) => pick(Float::Multiply, Float::MultiplyNegate),
        (false, _) => pick(Float::Add, Float::Subtract),
        (true, 0) if !variant => Float::Divide,
        (true, 1) => pick(Float::FusedNegateSubtract, Float::FusedNegateAccumulate),
        (true, 2) => pick(Float::FusedAccumulate, Float::FusedSubtract),
        (true, 3) => return other(first, second),
        _ => return UNDEFINED,
    };
    Instruction::new(Op::Float(float)).d(d(first, second)).n(n(first, second)).m(m(second))
}

/// The operations with one operand (A6.4, table A6-3).
fn other(first: u16, second: u16) -> Instruction {
    let d = d(first, second);
    let base = |float| Instruction::new(Op::Float(float)).d(d).m(m(second));
    if !bit(second, 6) {
        let immediate = bits(first, 3, 0) << 4 | bits(second, 3, 0);
        return base(Float::MoveImmediate).immediate(expand_immediate(immediate));
    }
    let top = bit(second, 7);
    let variant = Flags::VARIANT.when(top);
    match bits(first, 3, 0) {
        0 => base(if top { Float::Absolute } else { Float::Move }),
        1 => base(if top { Float::SquareRoot } else { Float::Negate }),
        2 => base(Float::FromHalf).flags(variant),
        3 => base(Float::ToHalf).flags(variant),
        4 => base(Float::Compare).flags(variant),
        5 => base(Float::CompareZero).flags(variant),
        8 => base(if top { Float::FromSigned } else { Float::FromUnsigned }),
        10 => fixed(Float::FromSignedFixed, d, second),
        11 => fixed(Float::FromUnsignedFixed, d, second),
        12 => base(Float::ToUnsigned).flags(Flags::VARIANT.when(!top)),
        13 => base(Float::ToSigned).flags(Flags::VARIANT.when(!top)),
        14 => fixed(Float::ToSignedFixed, d, second),
        15 => fixed(Float::ToUnsignedFixed, d, second),
        _ => UNDEFINED,
    }
}

fn fixed(float: Float, d: u16, second: u16) -> Instruction {
    let size = if bit(second, 7) { 32 } else { 16 };
    let immediate = bits(second, 3, 0) << 1 | bits(second, 5, 5);
    if immediate > size {
        return UNDEFINED;
    }
    Instruction::new(Op::Float(float)).d(d).a(size).immediate(u32::from(size - immediate))
}

/// VFPExpandImm() for singles: a sign, three bits of exponent and four of fraction (A6.4.1).
fn expand_immediate(byte: u16) -> u32 {
    let byte = u32::from(byte);
    let exponent = if byte & 0x40 != 0 { 0x1f << 25 } else { 1 << 30 };
    (byte & 0x80) << 24 | exponent | (byte & 0x3f) << 19
}

/// Transfers between one core register and the extension (A6.6).
fn transfer(first: u16, second: u16) -> Instruction {
    let t = bits(second, 15, 12);
    let to_core = bit(first, 4);
    let direction = |from, to| Instruction::new(Op::Float(if to_core { to } else { from })).d(t);
    let single = |n| direction(Float::FromCore, Float::ToCore).n(n);
    match (bit(second, 8), bits(first, 7, 5)) {
        (false, 0) if t != 15 => single(n(first, second)),
        (false, 7) if bits(first, 3, 0) == 1 && (to_core || t != 15) => {
            direction(Float::StatusFromCore, Float::StatusToCore)
        }
        (true, half @ (0 | 1)) if t != 15 && bits(second, 6, 5) == 0 => {
            single(double(bits(first, 3, 0), bit(second, 7)) + half)
        }
        _ => UNDEFINED,
    }
}

/// Transfers between two core registers and the extension (A6.7).
fn transfer_pair(first: u16, second: u16) -> Instruction {
    let (t, t2) = (bits(second, 15, 12), bits(first, 3, 0));
    let m = if bit(second, 8) { double(bits(second, 3, 0), bit(second, 5)) } else { m(second) };
    if bits(second, 7, 6) != 0 || !bit(second, 4) || t == 15 || t2 == 15 || m > 30 {
        return UNDEFINED;
    }
    let float = if bit(first, 4) { Float::ToCorePair } else { Float::FromCorePair };
    Instruction::new(Op::Float(float)).d(t).n(t2).m(m)
}

/// Loads and stores (A6.5).
fn memory(first: u16, second: u16) -> Instruction {
    let (pre, up, back, load) = (bit(first, 8), bit(first, 7), bit(first, 5), bit(first, 4));
    let n = bits(first, 3, 0);
    let (start, words) = if bit(second, 8) {
        (double(bits(second, 15, 12), bit(first, 6)), second & 0xfe)
    } else {
        (d(first, second), second & 0xff)
    };
    if pre && !back {
        let offset = u32::from(second & 0xff) << 2;
        let words = if bit(second, 8) { 2 } else { 1 };
        let op = if load { Op::FloatLoad } else { Op::FloatStore };
        let offset = if up { offset } else { offset.wrapping_neg() };
        return if start + words > 32 {
            UNDEFINED
        } else {
            Instruction::new(op).d(start).n(n).a(words).immediate(offset)
        };
    }
    // The legacy odd word count of FLDMX moves the base over one word more than it transfers.
    let span = u32::from(second & 0xff) << 2;
    if (pre == up) || words == 0 || start + words > 32 || (n == 15 && (back || !load)) {
        return UNDEFINED;
    }
    let op = if load { Op::FloatLoadMultiple } else { Op::FloatStoreMultiple };
    let flags = Flags::WRITE_BACK.when(back).with(Flags::VARIANT.when(pre));
    Instruction::new(op).d(start).n(n).a(words).immediate(span).flags(flags)
}
