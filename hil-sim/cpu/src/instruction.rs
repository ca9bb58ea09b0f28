//! A decoded instruction: what the decoder writes and the executor reads.

pub(crate) use crate::operation::{Alu, Extend, Float, Lane, Multiply, Op, Parallel, Reverse, Shift, Width};

/// One decoded instruction. Each operation states whether the register fields are core or single-precision registers,
/// and what `immediate` holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instruction {
    pub op: Op,
    pub d: u8,
    pub n: u8,
    pub m: u8,
    pub a: u8,
    pub flags: Flags,
    pub immediate: u32,
}

/// Modifiers of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) struct Flags(u8);

impl Flags {
    pub const NONE: Self = Self(0);
    /// The instruction takes four bytes of code.
    pub const WIDE: Self = Self(1);
    /// Updates the condition flags.
    pub const SET: Self = Self(2);
    /// Updates the condition flags only outside an IT block.
    pub const SET_OUTSIDE_IT: Self = Self(2 | 4);
    /// The rotation of the immediate produced a carry: bit 31 of the immediate.
    pub const CARRY: Self = Self(8);
    /// Writes the address back to the base register.
    pub const WRITE_BACK: Self = Self(16);
    /// Adds the offset before the access.
    pub const PRE_INDEX: Self = Self(32);
    /// Variant of the operation: subtract, exchange, round, top half... as the operation says.
    pub const VARIANT: Self = Self(64);
    /// Access as if unprivileged.
    pub const UNPRIVILEGED: Self = Self(128);

    #[inline(always)]
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub const fn when(self, condition: bool) -> Self {
        if condition { self } else { Self::NONE }
    }

    /// Inside an IT block the 16-bit data-processing instructions leave the flags alone.
    pub const fn inside_it(self) -> Self {
        if self.has(Self::SET_OUTSIDE_IT) { Self(self.0 & !Self::SET_OUTSIDE_IT.0) } else { self }
    }
}

impl Instruction {
    pub const fn new(op: Op) -> Self {
        Self { op, d: 0, n: 0, m: 0, a: 0, flags: Flags::NONE, immediate: 0 }
    }

    pub const fn d(mut self, d: u16) -> Self {
        self.d = d as u8;
        self
    }

    pub const fn n(mut self, n: u16) -> Self {
        self.n = n as u8;
        self
    }

    pub const fn m(mut self, m: u16) -> Self {
        self.m = m as u8;
        self
    }

    pub const fn a(mut self, a: u16) -> Self {
        self.a = a as u8;
        self
    }

    pub const fn immediate(mut self, immediate: u32) -> Self {
        self.immediate = immediate;
        self
    }

    pub const fn flags(mut self, flags: Flags) -> Self {
        self.flags = self.flags.with(flags);
        self
    }

    /// Length of the instruction in bytes of code.
    #[inline(always)]
    pub const fn length(&self) -> u32 {
        if self.flags.has(Flags::WIDE) { 4 } else { 2 }
    }
}
