//! Families of encodings with every field drawn at random: immediates, rotations, shifts, widths, register numbers. The
//! instruction is written to RAM and run there.

use core::arch::asm;
use core::sync::atomic::{AtomicU16, Ordering::Relaxed};

use crate::call::{Context, Form};
use crate::operands::Operands;

/// Where a register number goes: half-word, lowest bit, and how many numbers there are.
#[derive(Clone, Copy)]
pub struct Field(pub usize, pub u32, pub u16);

/// Core registers R0 to R4 in the usual places.
pub const N: Field = Field(0, 0, 5);
pub const D: Field = Field(1, 8, 5);
pub const T: Field = Field(1, 12, 5);
pub const M: Field = Field(1, 0, 5);
/// Pairs of single-precision registers, S0 to S3; the lowest bit of the number is drawn with the rest.
pub const VN: Field = Field(0, 0, 2);
pub const VD: Field = Field(1, 12, 2);
pub const VM: Field = Field(1, 0, 2);

/// An encoding, the bits of it to draw, its registers, and which draws the architecture defines.
pub struct Family {
    pub name: &'static str,
    pub base: [u16; 2],
    pub drawn: [u16; 2],
    pub registers: &'static [Field],
    pub defined: fn(u16, u16) -> bool,
}

impl Family {
    pub const fn new(name: &'static str, base: [u16; 2], drawn: [u16; 2], registers: &'static [Field]) -> Self {
        Self { name, base, drawn, registers, defined: |_, _| true }
    }

    pub const fn when(mut self, defined: fn(u16, u16) -> bool) -> Self {
        self.defined = defined;
        self
    }

    /// The next encoding; narrow ones have a second half-word of NOP.
    fn draw(&self, operands: &mut Operands) -> [u16; 2] {
        loop {
            let mut halves = [0, 1].map(|half| self.base[half] | operands.any() as u16 & self.drawn[half]);
            for &Field(half, shift, count) in self.registers {
                halves[half] |= ((operands.any() >> 8) as u16 % count) << shift;
            }
            if (self.defined)(halves[0], halves[1]) {
                return halves;
            }
        }
    }
}

/// Bits `high..=low` of a half-word.
pub fn bits(half: u16, high: u32, low: u32) -> u16 {
    (half >> low) & ((1 << (high - low + 1)) - 1)
}

const RETURN: u16 = 0x4770;

#[repr(align(4))]
struct Code([AtomicU16; 4]);

static CODE: Code = Code([const { AtomicU16::new(RETURN) }; 4]);

/// Runs one drawn instruction on drawn operands.
pub fn run(family: &Family, operands: &mut Operands, float: bool) -> Context {
    for (place, half) in CODE.0.iter().zip(family.draw(operands)) {
        place.store(half, Relaxed);
    }
    // SAFETY: orders the stores before the fetch; the buffer holds one instruction and a return.
    let code = unsafe {
        asm!("dsb", "isb", options(nostack));
        core::mem::transmute::<usize, unsafe extern "C" fn()>(CODE.0.as_ptr() as usize | 1)
    };
    let mut context = Context::new(&Form { text: family.name, code });
    crate::draw(&mut context, operands, float);
    context.fpscr = operands.any() & 0x07c0_009f;
    context.run();
    context
}
