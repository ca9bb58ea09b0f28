//! Data processing, bit fields, saturation (A7.7).

use crate::cpu::Cpu;
use crate::instruction::{Alu, Extend, Flags, Instruction, Reverse, Shift};

/// Shift_C() (A2.2.1): the value and the carry out.
#[inline(always)]
fn shift(value: u32, kind: Shift, amount: u32, carry: bool) -> (u32, bool) {
    if amount == 0 {
        return (value, carry);
    }
    match kind {
        Shift::Left if amount < 32 => (value << amount, value >> (32 - amount) & 1 != 0),
        Shift::Left => (0, amount == 32 && value & 1 != 0),
        Shift::Right if amount < 32 => (value >> amount, value >> (amount - 1) & 1 != 0),
        Shift::Right => (0, amount == 32 && value >> 31 != 0),
        Shift::Arithmetic => {
            let amount = amount.min(32);
            let last = value as i32 >> (amount - 1);
            ((last >> 1) as u32, last & 1 != 0)
        }
        Shift::Rotate => {
            let result = value.rotate_right(amount & 31);
            (result, result >> 31 != 0)
        }
        Shift::Extended => (value >> 1 | u32::from(carry) << 31, value & 1 != 0),
    }
}

impl Cpu {
    #[inline(always)]
    pub(super) fn alu_immediate(&mut self, alu: Alu, i: &Instruction) {
        let carry = if i.flags.has(Flags::CARRY) { i.immediate >> 31 != 0 } else { self.c };
        self.alu(alu, i, i.immediate, carry);
    }

    #[inline(always)]
    pub(super) fn alu_register(&mut self, alu: Alu, i: &Instruction) {
        self.alu(alu, i, self.read(i.m), self.c);
    }

    #[inline(always)]
    pub(super) fn alu_shifted(&mut self, alu: Alu, i: &Instruction) {
        let (kind, amount) = Shift::unpack(i.immediate);
        let (operand, carry) = shift(self.read(i.m), kind, amount, self.c);
        self.alu(alu, i, operand, carry);
    }

    #[inline(always)]
    pub(super) fn shift_register(&mut self, kind: Shift, i: &Instruction) {
        let (result, carry) = shift(self.read(i.n), kind, self.read(i.m) & 0xff, self.c);
        self.logical(i, result, carry);
    }

    #[inline(always)]
    fn alu(&mut self, alu: Alu, i: &Instruction, operand: u32, carry: bool) {
        let n = self.read(i.n);
        match alu {
            Alu::And => self.logical(i, n & operand, carry),
            Alu::BitClear => self.logical(i, n & !operand, carry),
            Alu::Or => self.logical(i, n | operand, carry),
            Alu::OrNot => self.logical(i, n | !operand, carry),
            Alu::ExclusiveOr => self.logical(i, n ^ operand, carry),
            Alu::Move => self.logical(i, operand, carry),
            Alu::MoveNot => self.logical(i, !operand, carry),
            Alu::Test => self.logical_flags(n & operand, carry),
            Alu::TestEqual => self.logical_flags(n ^ operand, carry),
            Alu::Add => self.sum(i, n, operand, false),
            Alu::AddCarry => self.sum(i, n, operand, self.c),
            Alu::Subtract => self.sum(i, n, !operand, true),
            Alu::SubtractCarry => self.sum(i, n, !operand, self.c),
            Alu::ReverseSubtract => self.sum(i, !n, operand, true),
            Alu::Compare => {
                self.add_with_flags(n, !operand, true);
            }
            Alu::CompareNegative => {
                self.add_with_flags(n, operand, false);
            }
        }
    }

    #[inline(always)]
    fn logical(&mut self, i: &Instruction, result: u32, carry: bool) {
        self.write(i.d, result);
        if i.flags.has(Flags::SET) {
            self.logical_flags(result, carry);
        }
    }

    #[inline(always)]
    fn logical_flags(&mut self, result: u32, carry: bool) {
        self.set_sign_flags(result);
        self.c = carry;
    }

    #[inline(always)]
    pub(super) fn set_sign_flags(&mut self, result: u32) {
        self.n = result >> 31 != 0;
        self.z = result == 0;
    }

    #[inline(always)]
    fn sum(&mut self, i: &Instruction, x: u32, y: u32, carry: bool) {
        let result = if i.flags.has(Flags::SET) {
            self.add_with_flags(x, y, carry)
        } else {
            x.wrapping_add(y).wrapping_add(u32::from(carry))
        };
        self.write(i.d, result);
    }

    /// AddWithCarry() (A2.2.1).
    #[inline(always)]
    fn add_with_flags(&mut self, x: u32, y: u32, carry: bool) -> u32 {
        let (partial, first) = x.overflowing_add(y);
        let (result, second) = partial.overflowing_add(u32::from(carry));
        self.set_sign_flags(result);
        self.c = first | second;
        self.v = (x ^ result) & (y ^ result) & 1 << 31 != 0;
        result
    }

    #[inline(always)]
    pub(super) fn bitfield_insert(&mut self, i: &Instruction) {
        let mask = (u32::MAX >> (32 - u32::from(i.a))) << i.immediate;
        let source = if i.m == 15 { 0 } else { self.read(i.m) << i.immediate };
        self.write(i.d, self.read(i.d) & !mask | source & mask);
    }

    #[inline(always)]
    pub(super) fn unsigned_extract(&mut self, i: &Instruction) {
        self.write(i.d, self.read(i.n) >> i.immediate & u32::MAX >> (32 - u32::from(i.a)));
    }

    #[inline(always)]
    pub(super) fn signed_extract(&mut self, i: &Instruction) {
        let above = 32 - u32::from(i.a);
        let field = self.read(i.n) << (above - i.immediate);
        self.write(i.d, (field as i32 >> above) as u32);
    }

    #[inline(always)]
    pub(super) fn extend(&mut self, kind: Extend, i: &Instruction) {
        let value = self.read(i.m).rotate_right(i.immediate);
        let base = if i.n == 15 { 0 } else { self.read(i.n) };
        let halves = |low: u32, high: u32| {
            let low = base.wrapping_add(low) & 0xffff;
            low | (base >> 16).wrapping_add(high) << 16
        };
        let result = match kind {
            Extend::SignedByte => base.wrapping_add(value as i8 as u32),
            Extend::SignedHalf => base.wrapping_add(value as i16 as u32),
            Extend::UnsignedByte => base.wrapping_add(value & 0xff),
            Extend::UnsignedHalf => base.wrapping_add(value & 0xffff),
            Extend::SignedBytes16 => halves(value as i8 as u32, (value >> 16) as i8 as u32),
            Extend::UnsignedBytes16 => halves(value & 0xff, value >> 16 & 0xff),
        };
        self.write(i.d, result);
    }

    #[inline(always)]
    pub(super) fn reverse(&mut self, kind: Reverse, i: &Instruction) {
        let value = self.read(i.m);
        let result = match kind {
            Reverse::Bytes => value.swap_bytes(),
            Reverse::BytesInHalves => value.swap_bytes().rotate_left(16),
            Reverse::SignedHalf => (value as u16).swap_bytes() as i16 as u32,
            Reverse::Bits => value.reverse_bits(),
            Reverse::LeadingZeros => value.leading_zeros(),
        };
        self.write(i.d, result);
    }

    pub(super) fn signed_saturate(&mut self, i: &Instruction) {
        let operand = self.saturation_operand(i);
        let result = self.saturate_signed(i64::from(operand), u32::from(i.a));
        self.write(i.d, result);
    }

    pub(super) fn unsigned_saturate(&mut self, i: &Instruction) {
        let operand = self.saturation_operand(i);
        let result = self.saturate_unsigned(i64::from(operand), u32::from(i.a));
        self.write(i.d, result);
    }

    fn saturation_operand(&self, i: &Instruction) -> i32 {
        let (kind, amount) = Shift::unpack(i.immediate);
        shift(self.read(i.n), kind, amount, false).0 as i32
    }

    pub(super) fn signed_saturate16(&mut self, i: &Instruction) {
        let (low, high) = signed_halves(self.read(i.n));
        let low = self.saturate_signed(low, u32::from(i.a)) & 0xffff;
        let high = self.saturate_signed(high, u32::from(i.a)) << 16;
        self.write(i.d, low | high);
    }

    pub(super) fn unsigned_saturate16(&mut self, i: &Instruction) {
        let (low, high) = signed_halves(self.read(i.n));
        let low = self.saturate_unsigned(low, u32::from(i.a));
        let high = self.saturate_unsigned(high, u32::from(i.a)) << 16;
        self.write(i.d, low | high);
    }

    /// SignedSat() to 1 to 32 bits; saturation sets Q.
    pub(super) fn saturate_signed(&mut self, value: i64, width: u32) -> u32 {
        let limit = 1_i64 << (width - 1);
        let clamped = value.clamp(-limit, limit - 1);
        self.q |= clamped != value;
        clamped as u32
    }

    fn saturate_unsigned(&mut self, value: i64, width: u32) -> u32 {
        let clamped = value.clamp(0, (1_i64 << width) - 1);
        self.q |= clamped != value;
        clamped as u32
    }

    pub(super) fn pack_halves(&mut self, i: &Instruction) {
        let (kind, amount) = Shift::unpack(i.immediate);
        let shifted = shift(self.read(i.m), kind, amount, false).0;
        let n = self.read(i.n);
        let result = if i.flags.has(Flags::VARIANT) {
            n & 0xffff_0000 | shifted & 0xffff
        } else {
            n & 0xffff | shifted & 0xffff_0000
        };
        self.write(i.d, result);
    }
}

/// The low and the high half as signed numbers.
pub(super) fn signed_halves(word: u32) -> (i64, i64) {
    (i64::from(word as i16), i64::from((word >> 16) as i16))
}
