//! Differential test of the core: the same bytes run on the core and on QEMU's `mps2-an386`, and print the same lines.
//!
//! Each line is a hash over the results of one instruction form for many operand sets, or the events of one exception
//! scenario. Nothing hashed depends on where code or data were linked.
#![no_std]
#![no_main]

mod call;
mod encodings;
mod events;
mod families;
mod forms;
mod operands;
mod print;
mod scenarios;
mod start;

use call::{Context, Form};
use encodings::Family;
use operands::Operands;
use print::Line;

/// Operand sets for each integer form, and for each mode of a floating-point form.
const SETS: u32 = 256;
/// FPSCR modes: four roundings, each with and without flush-to-zero, default NaN and alternative half precision.
const MODES: u32 = 32;

/// Draws from each family of encodings.
const DRAWS: u32 = 4096;

/// The program, called by `start`.
pub fn main() {
    for group in forms::INTEGER {
        for form in group.iter() {
            print_hash(form.text, integer(form));
        }
    }
    for form in forms::FLOAT {
        print_hash(form.text, float(form));
    }
    for (list, float) in [(families::INTEGER, false), (families::FLOAT, true)] {
        for family in list {
            print_hash(family.name, drawn(family, float));
        }
    }
    scenarios::run();
    Line::new().text("END").print();
}

fn integer(form: &Form) -> u32 {
    let mut operands = Operands::new();
    let mut hash = Hash::new();
    for _ in 0..SETS {
        let mut context = Context::new(form);
        draw(&mut context, &mut operands, false);
        context.run();
        hash.context(&context);
    }
    hash.0
}

fn float(form: &Form) -> u32 {
    let mut operands = Operands::new();
    let mut hash = Hash::new();
    for mode in 0..MODES {
        for _ in 0..SETS {
            let mut context = Context::new(form);
            draw(&mut context, &mut operands, true);
            // Exceptions recorded before: what is set stays set.
            context.fpscr = mode << 22 | operands.any() & 0x9f;
            context.run();
            hash.context(&context);
        }
    }
    hash.0
}

fn drawn(family: &Family, float: bool) -> u32 {
    let mut operands = Operands::new();
    let mut hash = Hash::new();
    for _ in 0..DRAWS {
        hash.context(&encodings::run(family, &mut operands, float));
    }
    hash.0
}

/// Operands for a form: words and flags, or with `float` numbers in the S registers; any words in memory.
fn draw(context: &mut Context, operands: &mut Operands, float: bool) {
    context.r[..5].fill_with(|| operands.integer());
    if float {
        context.s.fill_with(|| operands.float());
    } else {
        context.apsr = operands.integer() & 0xf80f_0000;
    }
    // One draw makes them all: most forms leave memory alone.
    let mut word = operands.any();
    for place in &mut context.scratch {
        word = word.wrapping_mul(0x9e37_79b1).rotate_left(7);
        *place = word;
    }
}

fn print_hash(text: &str, hash: u32) {
    Line::new().hex(hash).text(" ").text(text).print();
}

/// FNV-1a over words, with a rotation so that the high bits of a word reach the low bits of the hash.
struct Hash(u32);

impl Hash {
    fn new() -> Self {
        Self(0x811c_9dc5)
    }

    fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0100_0193).rotate_left(5);
    }

    fn context(&mut self, context: &Context) {
        context.r[..5].iter().for_each(|&word| self.word(word));
        self.word(context.moved());
        self.word(context.apsr & 0xf80f_0000);
        self.word(context.fpscr);
        context.s.iter().for_each(|&word| self.word(word));
        context.scratch.iter().for_each(|&word| self.word(word));
    }
}
