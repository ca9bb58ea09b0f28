//! 16-bit instructions (A5.2).

use super::{bit, bits, sign_extend};
use crate::instruction::{Alu, Extend, Flags, Instruction, Multiply, Op, Reverse, Shift, Width};

const STACK_POINTER: u16 = 13;
const LINK: u32 = 1 << 14;
const PROGRAM_COUNTER: u32 = 1 << 15;

pub(super) fn decode(half: u16) -> Instruction {
    match half >> 11 {
        kind @ 0..=2 => alu(Op::AluShifted(Alu::Move), bits(half, 2, 0), 0)
            .m(bits(half, 5, 3))
            .immediate(Shift::from_immediate(kind, bits(half, 10, 6))),
        3 => add_subtract(half),
        4..=7 => immediate(half),
        8 if !bit(half, 10) => data_processing(half),
        8 => special(half),
        9 => Instruction::new(Op::LoadLiteral(Width::Word)).d(bits(half, 10, 8)).immediate(byte(half) << 2),
        10 | 11 => register_offset(half),
        12 | 13 => immediate_offset(half, Width::Word, 2),
        14 | 15 => immediate_offset(half, Width::Byte, 0),
        16 | 17 => immediate_offset(half, Width::Half, 1),
        18 => stack_relative(Op::StoreOffset(Width::Word), half),
        19 => stack_relative(Op::LoadOffset(Width::Word), half),
        20 => Instruction::new(Op::Address).d(bits(half, 10, 8)).immediate(byte(half) << 2),
        21 => Instruction::new(Op::AluImmediate(Alu::Add))
            .d(bits(half, 10, 8))
            .n(STACK_POINTER)
            .immediate(byte(half) << 2),
        22 | 23 => miscellaneous(half),
        24 => multiple(Op::StoreMultiple, half),
        25 => multiple(Op::LoadMultiple, half),
        26 | 27 => conditional(half),
        _ => Instruction::new(Op::Branch).immediate(sign_extend(u32::from(bits(half, 10, 0)) << 1, 12)),
    }
}

fn byte(half: u16) -> u32 {
    u32::from(half & 0xff)
}

fn alu(op: Op, d: u16, n: u16) -> Instruction {
    Instruction::new(op).d(d).n(n).flags(Flags::SET_OUTSIDE_IT)
}

fn add_subtract(half: u16) -> Instruction {
    let operation = if bit(half, 9) { Alu::Subtract } else { Alu::Add };
    let operand = bits(half, 8, 6);
    if bit(half, 10) {
        alu(Op::AluImmediate(operation), bits(half, 2, 0), bits(half, 5, 3)).immediate(u32::from(operand))
    } else {
        alu(Op::AluRegister(operation), bits(half, 2, 0), bits(half, 5, 3)).m(operand)
    }
}

fn immediate(half: u16) -> Instruction {
    let register = bits(half, 10, 8);
    let instruction = |operation| alu(Op::AluImmediate(operation), register, register).immediate(byte(half));
    match bits(half, 12, 11) {
        0 => instruction(Alu::Move),
        1 => Instruction::new(Op::AluImmediate(Alu::Compare)).n(register).immediate(byte(half)).flags(Flags::SET),
        2 => instruction(Alu::Add),
        _ => instruction(Alu::Subtract),
    }
}

fn data_processing(half: u16) -> Instruction {
    let (d, m) = (bits(half, 2, 0), bits(half, 5, 3));
    let two = |operation| alu(Op::AluRegister(operation), d, d).m(m);
    let shift = |kind| alu(Op::ShiftRegister(kind), d, d).m(m);
    let compare = |operation| Instruction::new(Op::AluRegister(operation)).n(d).m(m).flags(Flags::SET);
    match bits(half, 9, 6) {
        0 => two(Alu::And),
        1 => two(Alu::ExclusiveOr),
        2 => shift(Shift::Left),
        3 => shift(Shift::Right),
        4 => shift(Shift::Arithmetic),
        5 => two(Alu::AddCarry),
        6 => two(Alu::SubtractCarry),
        7 => shift(Shift::Rotate),
        8 => compare(Alu::Test),
        9 => alu(Op::AluImmediate(Alu::ReverseSubtract), d, m),
        10 => compare(Alu::Compare),
        11 => compare(Alu::CompareNegative),
        12 => two(Alu::Or),
        13 => alu(Op::Multiply(Multiply::Low), d, m).m(d),
        14 => two(Alu::BitClear),
        _ => two(Alu::MoveNot),
    }
}

/// High registers, and branches to a register (A5.2.3).
fn special(half: u16) -> Instruction {
    let d = bits(half, 2, 0) | bits(half, 7, 7) << 3;
    let m = bits(half, 6, 3);
    match bits(half, 9, 8) {
        0 if d == 15 => Instruction::new(Op::AddToPc).m(m),
        0 => Instruction::new(Op::AluRegister(Alu::Add)).d(d).n(d).m(m),
        1 => Instruction::new(Op::AluRegister(Alu::Compare)).n(d).m(m).flags(Flags::SET),
        2 if d == 15 => Instruction::new(Op::MoveToPc).m(m),
        2 => Instruction::new(Op::AluRegister(Alu::Move)).d(d).m(m),
        _ if bit(half, 7) => Instruction::new(Op::BranchLinkExchange).m(m),
        _ => Instruction::new(Op::BranchExchange).m(m),
    }
}

fn register_offset(half: u16) -> Instruction {
    let op = match bits(half, 11, 9) {
        0 => Op::StoreRegister(Width::Word),
        1 => Op::StoreRegister(Width::Half),
        2 => Op::StoreRegister(Width::Byte),
        3 => Op::LoadRegister(Width::SignedByte),
        4 => Op::LoadRegister(Width::Word),
        5 => Op::LoadRegister(Width::Half),
        6 => Op::LoadRegister(Width::Byte),
        _ => Op::LoadRegister(Width::SignedHalf),
    };
    Instruction::new(op).d(bits(half, 2, 0)).n(bits(half, 5, 3)).m(bits(half, 8, 6))
}

fn immediate_offset(half: u16, width: Width, scale: u32) -> Instruction {
    let op = if bit(half, 11) { Op::LoadOffset(width) } else { Op::StoreOffset(width) };
    Instruction::new(op).d(bits(half, 2, 0)).n(bits(half, 5, 3)).immediate(u32::from(bits(half, 10, 6)) << scale)
}

fn stack_relative(op: Op, half: u16) -> Instruction {
    Instruction::new(op).d(bits(half, 10, 8)).n(STACK_POINTER).immediate(byte(half) << 2)
}

/// A load that also loads its base does not write it back (A7.7.41).
fn multiple(op: Op, half: u16) -> Instruction {
    let (n, list) = (bits(half, 10, 8), byte(half));
    let write_back = op == Op::StoreMultiple || list >> n & 1 == 0;
    Instruction::new(op).n(n).immediate(list).flags(Flags::WRITE_BACK.when(write_back))
}

fn miscellaneous(half: u16) -> Instruction {
    let (d, m) = (bits(half, 2, 0), bits(half, 5, 3));
    match bits(half, 11, 8) {
        0 => {
            let operation = if bit(half, 7) { Alu::Subtract } else { Alu::Add };
            let amount = u32::from(bits(half, 6, 0)) << 2;
            Instruction::new(Op::AluImmediate(operation)).d(STACK_POINTER).n(STACK_POINTER).immediate(amount)
        }
        1 | 3 | 9 | 11 => Instruction::new(Op::CompareBranch)
            .n(d)
            .immediate(u32::from(bits(half, 7, 3) << 1 | bits(half, 9, 9) << 6))
            .flags(Flags::VARIANT.when(bit(half, 11))),
        2 => {
            let kind = [Extend::SignedHalf, Extend::SignedByte, Extend::UnsignedHalf, Extend::UnsignedByte];
            Instruction::new(Op::Extend(kind[usize::from(bits(half, 7, 6))])).d(d).n(15).m(m)
        }
        4 | 5 => stack(Op::StoreMultiple, byte(half) | if bit(half, 8) { LINK } else { 0 }).flags(Flags::VARIANT),
        6 if half & 0xffe8 == 0xb660 => Instruction::new(Op::ChangeState)
            .immediate(u32::from(bits(half, 1, 0)))
            .flags(Flags::VARIANT.when(bit(half, 4))),
        10 => match bits(half, 7, 6) {
            0 => Instruction::new(Op::Reverse(Reverse::Bytes)).d(d).m(m),
            1 => Instruction::new(Op::Reverse(Reverse::BytesInHalves)).d(d).m(m),
            3 => Instruction::new(Op::Reverse(Reverse::SignedHalf)).d(d).m(m),
            _ => Instruction::new(Op::Undefined),
        },
        12 | 13 => stack(Op::LoadMultiple, byte(half) | if bit(half, 8) { PROGRAM_COUNTER } else { 0 }),
        14 => Instruction::new(Op::Breakpoint).immediate(byte(half)),
        15 if bits(half, 3, 0) != 0 => Instruction::new(Op::IfThen).immediate(byte(half)),
        15 => hint(bits(half, 7, 4)),
        _ => Instruction::new(Op::Undefined),
    }
}

fn stack(op: Op, list: u32) -> Instruction {
    Instruction::new(op).n(STACK_POINTER).immediate(list).flags(Flags::WRITE_BACK)
}

/// Unallocated hints do nothing.
pub(super) fn hint(kind: u16) -> Instruction {
    Instruction::new(match kind {
        2 => Op::WaitForEvent,
        3 => Op::WaitForInterrupt,
        4 => Op::SendEvent,
        _ => Op::Nop,
    })
}

fn conditional(half: u16) -> Instruction {
    match bits(half, 11, 8) {
        14 => Instruction::new(Op::Undefined),
        15 => Instruction::new(Op::SupervisorCall).immediate(byte(half)),
        condition => Instruction::new(Op::BranchIf).d(condition).immediate(sign_extend(byte(half) << 1, 9)),
    }
}
