//! Thumb and Thumb-2 decoding, ARMv7-M Architecture Reference Manual (ARM DDI 0403E) chapter A5.

mod float;
mod memory;
mod multiply;
mod thumb16;
mod thumb32;

use crate::instruction::{Flags, Instruction};

/// Whether a half-word is the first of a 32-bit instruction (A5.1).
pub(crate) const fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Decodes a 16-bit instruction.
pub(crate) fn narrow(half: u16) -> Instruction {
    thumb16::decode(half)
}

/// Decodes a 32-bit instruction from its half-words in order.
pub(crate) fn wide(first: u16, second: u16) -> Instruction {
    thumb32::decode(first, second).flags(Flags::WIDE)
}

/// Bits `high..=low` of a half-word.
const fn bits(half: u16, high: u32, low: u32) -> u16 {
    (half >> low) & ((1u16 << (high - low + 1)) - 1)
}

/// One bit of a half-word.
const fn bit(half: u16, index: u32) -> bool {
    half >> index & 1 != 0
}

/// Sign-extends the low `width` bits.
const fn sign_extend(value: u32, width: u32) -> u32 {
    ((value << (32 - width)) as i32 >> (32 - width)) as u32
}
