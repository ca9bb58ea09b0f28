//! Floating-point instructions: operands and registers; the arithmetic is in [`crate::float`].

use super::Trap;
use crate::bus::{Access, Bus};
use crate::cpu::Cpu;
use crate::float::{Environment, Integer, Rounding, SIGN};
use crate::instruction::{Flags, Float, Instruction};

/// Cortex-M4 TRM 3.3.3: cycles beyond the first.
const ACCUMULATE_CYCLES: u64 = 2;
const DIVIDE_CYCLES: u64 = 13;

impl Cpu {
    #[inline(always)]
    fn use_float<B: Bus>(&mut self, bus: &mut B) -> Result<(), Trap> {
        if self.float_ready { Ok(()) } else { self.prepare_float(bus) }
    }

    #[inline(always)]
    fn single(&self, register: u8) -> u32 {
        self.s[usize::from(register & 31)]
    }

    #[inline(always)]
    fn set_single(&mut self, register: u8, value: u32) {
        self.s[usize::from(register & 31)] = value;
    }

    #[inline(never)]
    pub(super) fn float<B: Bus>(&mut self, bus: &mut B, float: Float, i: &Instruction) -> Result<(), Trap> {
        self.use_float(bus)?;
        match float {
            Float::Move => self.set_single(i.d, self.single(i.m)),
            Float::MoveImmediate => self.set_single(i.d, i.immediate),
            Float::Absolute => self.set_single(i.d, self.single(i.m) & !SIGN),
            Float::Negate => self.set_single(i.d, self.single(i.m) ^ SIGN),
            Float::FromCore => self.set_single(i.n, self.read(i.d)),
            Float::ToCore => self.write(i.d, self.single(i.n)),
            Float::FromCorePair => {
                self.now += 1;
                self.set_single(i.m, self.read(i.d));
                self.set_single(i.m + 1, self.read(i.n));
            }
            Float::ToCorePair => {
                self.now += 1;
                let (low, high) = (self.single(i.m), self.single(i.m + 1));
                self.write(i.d, low);
                self.write(i.n, high);
            }
            Float::StatusFromCore => self.set_fpscr(self.read(i.d)),
            Float::StatusToCore if i.d == 15 => self.set_condition_flags(self.fpscr),
            Float::StatusToCore => self.write(i.d, self.fpscr),
            _ => self.compute(float, i),
        }
        Ok(())
    }

    fn compute(&mut self, float: Float, i: &Instruction) {
        let mut environment = Environment::new(self.fpscr);
        let (d, n, m) = (self.single(i.d), self.single(i.n), self.single(i.m));
        let variant = i.flags.has(Flags::VARIANT);
        match float {
            Float::Compare | Float::CompareZero => {
                let other = if float == Float::Compare { m } else { 0 };
                let flags = environment.compare(d, other, variant);
                self.fpscr = environment.fpscr() & 0x0fff_ffff | flags;
                return;
            }
            Float::Divide | Float::SquareRoot => self.now += DIVIDE_CYCLES,
            Float::MultiplyAccumulate
            | Float::MultiplySubtract
            | Float::NegateMultiplyAccumulate
            | Float::NegateMultiplySubtract
            | Float::FusedAccumulate
            | Float::FusedSubtract
            | Float::FusedNegateAccumulate
            | Float::FusedNegateSubtract => self.now += ACCUMULATE_CYCLES,
            _ => {}
        }
        let result = match float {
            Float::Add | Float::Subtract | Float::Multiply | Float::MultiplyNegate | Float::Divide => {
                two_operands(&mut environment, float, n, m)
            }
            Float::SquareRoot => environment.square_root(m),
            Float::FromHalf => environment.half_to_single((m >> (16 * u32::from(variant))) as u16),
            Float::ToHalf => {
                let half = u32::from(environment.single_to_half(m));
                if variant { d & 0xffff | half << 16 } else { d & 0xffff_0000 | half }
            }
            Float::FromSigned
            | Float::FromUnsigned
            | Float::ToSigned
            | Float::ToUnsigned
            | Float::FromSignedFixed
            | Float::FromUnsignedFixed
            | Float::ToSignedFixed
            | Float::ToUnsignedFixed => convert(&mut environment, float, i, d, m),
            _ => accumulate(&mut environment, float, [d, n, m]),
        };
        self.fpscr = environment.fpscr();
        self.set_single(i.d, result);
    }

    #[inline(never)]
    pub(super) fn float_load<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        self.use_float(bus)?;
        let base = if i.n == 15 { self.r[15] & !3 } else { self.read(i.n) };
        self.now += u64::from(i.a);
        self.load_singles(bus, i, base.wrapping_add(i.immediate))
    }

    #[inline(never)]
    pub(super) fn float_store<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        self.use_float(bus)?;
        let base = if i.n == 15 { self.r[15] & !3 } else { self.read(i.n) };
        self.now += u64::from(i.a);
        self.store_singles(bus, i, base.wrapping_add(i.immediate))
    }

    pub(super) fn float_load_multiple<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        self.use_float(bus)?;
        let (address, moved) = self.multiple_addresses(i, i.immediate);
        let address = if i.n == 15 { address & !3 } else { address };
        self.now += u64::from(i.a);
        self.load_singles(bus, i, address)?;
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        Ok(())
    }

    pub(super) fn float_store_multiple<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        self.use_float(bus)?;
        let (address, moved) = self.multiple_addresses(i, i.immediate);
        self.now += u64::from(i.a);
        self.store_singles(bus, i, address)?;
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        Ok(())
    }

    #[inline(always)]
    fn load_singles<B: Bus>(&mut self, bus: &mut B, i: &Instruction, address: u32) -> Result<(), Trap> {
        if address & 3 != 0 {
            return Err(Trap::Unaligned);
        }
        for index in 0..i.a {
            let value = self.load(bus, address.wrapping_add(4 * u32::from(index)), Access::Word)?;
            self.set_single(i.d + index, value);
        }
        Ok(())
    }

    #[inline(always)]
    fn store_singles<B: Bus>(&mut self, bus: &mut B, i: &Instruction, address: u32) -> Result<(), Trap> {
        if address & 3 != 0 {
            return Err(Trap::Unaligned);
        }
        for index in 0..i.a {
            let value = self.single(i.d + index);
            self.store(bus, address.wrapping_add(4 * u32::from(index)), Access::Word, value)?;
        }
        Ok(())
    }
}

fn two_operands(environment: &mut Environment, float: Float, n: u32, m: u32) -> u32 {
    match float {
        Float::Add => environment.add(n, m),
        Float::Subtract => environment.subtract(n, m),
        Float::Multiply => environment.multiply(n, m),
        Float::MultiplyNegate => environment.multiply(n, m) ^ SIGN,
        _ => environment.divide(n, m),
    }
}

/// The chained forms round the product first, the fused ones only once (A7.7.239, A7.7.230).
fn accumulate(environment: &mut Environment, float: Float, [d, n, m]: [u32; 3]) -> u32 {
    let (negate_d, negate_n) = match float {
        Float::MultiplyAccumulate | Float::FusedAccumulate => (0, 0),
        Float::MultiplySubtract | Float::FusedSubtract => (0, SIGN),
        Float::NegateMultiplyAccumulate | Float::FusedNegateAccumulate => (SIGN, SIGN),
        _ => (SIGN, 0),
    };
    match float {
        Float::FusedAccumulate | Float::FusedSubtract | Float::FusedNegateAccumulate | Float::FusedNegateSubtract => {
            environment.multiply_add(d ^ negate_d, n ^ negate_n, m)
        }
        _ => {
            let product = environment.multiply(n, m) ^ negate_n;
            environment.add(d ^ negate_d, product)
        }
    }
}

fn convert(environment: &mut Environment, float: Float, i: &Instruction, d: u32, m: u32) -> u32 {
    let fraction = i.immediate;
    let size = u32::from(i.a);
    let current = environment.rounding();
    let rounding = if i.flags.has(Flags::VARIANT) { current } else { Rounding::TowardZero };
    match float {
        Float::FromSigned => environment.integer_to_single(i64::from(m as i32), 0, current),
        Float::FromUnsigned => environment.integer_to_single(i64::from(m), 0, current),
        Float::ToSigned => environment.single_to_integer(m, 0, Integer { bits: 32, signed: true }, rounding),
        Float::ToUnsigned => environment.single_to_integer(m, 0, Integer { bits: 32, signed: false }, rounding),
        Float::FromSignedFixed | Float::FromUnsignedFixed => {
            let value = match (float == Float::FromSignedFixed, size) {
                (true, 16) => i64::from(d as i16),
                (true, _) => i64::from(d as i32),
                (false, 16) => i64::from(d & 0xffff),
                (false, _) => i64::from(d),
            };
            environment.integer_to_single(value, fraction, Rounding::Nearest)
        }
        _ => {
            let signed = float == Float::ToSignedFixed;
            environment.single_to_integer(d, fraction, Integer { bits: size, signed }, rounding)
        }
    }
}
