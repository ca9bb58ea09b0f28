//! 32-bit loads and stores (A5.3.5 to A5.3.10).

use super::thumb32::UNDEFINED;
use super::{bit, bits};
use crate::instruction::{Flags, Instruction, Op, Width};

/// Load and store multiple.
pub(super) fn multiple(first: u16, second: u16) -> Instruction {
    let (n, load) = (bits(first, 3, 0), bit(first, 4));
    let decrement = match bits(first, 8, 7) {
        1 => false,
        2 => true,
        _ => return UNDEFINED,
    };
    let allowed = if load { !0x2000u16 } else { !0xa000 };
    let list = u32::from(second & allowed);
    if n == 15 || list == 0 {
        return UNDEFINED;
    }
    let op = if load { Op::LoadMultiple } else { Op::StoreMultiple };
    let write_back = bit(first, 5) && (list >> n & 1 == 0 || !load);
    Instruction::new(op)
        .n(n)
        .immediate(list)
        .flags(Flags::WRITE_BACK.when(write_back).with(Flags::VARIANT.when(decrement)))
}

/// LDRD, STRD, the exclusives and the table branches.
pub(super) fn dual_or_exclusive(first: u16, second: u16) -> Instruction {
    let (n, t, t2) = (bits(first, 3, 0), bits(second, 15, 12), bits(second, 11, 8));
    let (pre, up, back, load) = (bit(first, 8), bit(first, 7), bit(first, 5), bit(first, 4));
    let offset = u32::from(second & 0xff) << 2;
    if pre || back {
        let op = if load { Op::LoadDual } else { Op::StoreDual };
        let flags = Flags::PRE_INDEX.when(pre).with(Flags::WRITE_BACK.when(back));
        let offset = if up { offset } else { offset.wrapping_neg() };
        return if t == 15 || t2 == 15 || (n == 15 && (!load || back)) {
            UNDEFINED
        } else {
            Instruction::new(op).n(n).d(t).a(t2).immediate(offset).flags(flags)
        };
    }
    match (up, load, bits(second, 7, 4)) {
        (false, false, _) => Instruction::new(Op::StoreExclusive(Width::Word)).n(n).a(t).d(t2).immediate(offset),
        (false, true, _) => Instruction::new(Op::LoadExclusive(Width::Word)).n(n).d(t).immediate(offset),
        (true, false, 4) => Instruction::new(Op::StoreExclusive(Width::Byte)).n(n).a(t).d(bits(second, 3, 0)),
        (true, false, 5) => Instruction::new(Op::StoreExclusive(Width::Half)).n(n).a(t).d(bits(second, 3, 0)),
        (true, true, 0 | 1) => {
            Instruction::new(Op::TableBranch).n(n).m(bits(second, 3, 0)).flags(Flags::VARIANT.when(bit(second, 4)))
        }
        (true, true, 4) => Instruction::new(Op::LoadExclusive(Width::Byte)).n(n).d(t),
        (true, true, 5) => Instruction::new(Op::LoadExclusive(Width::Half)).n(n).d(t),
        _ => UNDEFINED,
    }
}

/// Store single.
pub(super) fn store(first: u16, second: u16) -> Instruction {
    let (n, width) = (
        bits(first, 3, 0),
        match bits(first, 6, 5) {
            0 => Width::Byte,
            1 => Width::Half,
            2 => Width::Word,
            _ => return UNDEFINED,
        },
    );
    if n == 15 || bits(second, 15, 12) == 15 {
        return UNDEFINED;
    }
    single(first, second, [Op::StoreOffset(width), Op::StoreRegister(width), Op::StoreIndexed(width)])
}

/// Load single; a load of the PC that is not a word is a hint to the memory system, which has no cache to warm.
pub(super) fn load(first: u16, second: u16) -> Instruction {
    let (n, t, signed) = (bits(first, 3, 0), bits(second, 15, 12), bit(first, 8));
    let width = match (bits(first, 6, 5), signed) {
        (0, false) => Width::Byte,
        (0, true) => Width::SignedByte,
        (1, false) => Width::Half,
        (1, true) => Width::SignedHalf,
        (2, false) => Width::Word,
        _ => return UNDEFINED,
    };
    if n == 15 {
        let offset = u32::from(second & 0xfff);
        let offset = if bit(first, 7) { offset } else { offset.wrapping_neg() };
        return hint_or(width, Instruction::new(Op::LoadLiteral(width)).d(t).immediate(offset));
    }
    let instruction = single(first, second, [Op::LoadOffset(width), Op::LoadRegister(width), Op::LoadIndexed(width)]);
    if matches!(instruction.op, Op::LoadIndexed(_)) && t == 15 && width != Width::Word {
        return UNDEFINED;
    }
    hint_or(width, instruction)
}

fn hint_or(width: Width, load: Instruction) -> Instruction {
    if load.d == 15 && width != Width::Word && load.op != Op::Undefined { Instruction::new(Op::Nop) } else { load }
}

/// The addressing forms that all single loads and stores share: offset, register and indexed.
fn single(first: u16, second: u16, [offset, register, indexed]: [Op; 3]) -> Instruction {
    let base = Instruction::new(offset).n(bits(first, 3, 0)).d(bits(second, 15, 12));
    if bit(first, 7) {
        return base.immediate(u32::from(second & 0xfff));
    }
    let byte = u32::from(second & 0xff);
    let signed = if bit(second, 9) { byte } else { byte.wrapping_neg() };
    let form = bits(second, 11, 8);
    if bits(second, 11, 6) == 0 {
        let mut instruction = base.m(bits(second, 3, 0)).immediate(u32::from(bits(second, 5, 4)));
        instruction.op = register;
        return instruction;
    }
    let mut instruction = base.immediate(signed);
    match form {
        0xc => instruction,
        0xe => instruction.immediate(byte).flags(Flags::UNPRIVILEGED),
        0x9 | 0xb | 0xd | 0xf => {
            instruction.op = indexed;
            instruction.flags(Flags::WRITE_BACK.with(Flags::PRE_INDEX.when(bit(second, 10))))
        }
        _ => UNDEFINED,
    }
}
