//! Decoded instructions, kept per half-word of code.

use crate::instruction::{Instruction, Op};

/// Half-words that fit at once: 64 KiB of straight code, more than a controller's image executes.
const ENTRIES: usize = 1 << 15;
/// Stores look here first: one bit for each 1 KiB page, folded, in which something was decoded.
const PAGES: usize = 4096;

#[derive(Clone, Copy)]
struct Entry {
    address: u32,
    generation: u32,
    instruction: Instruction,
}

/// A direct-mapped table from code address to decoded instruction.
#[derive(Clone)]
pub(crate) struct Cache {
    entries: Box<[Entry]>,
    generation: u32,
    decoded: Box<[u64; PAGES / 64]>,
}

impl Cache {
    pub fn new() -> Self {
        let empty = Entry { address: 0, generation: 0, instruction: Instruction::new(Op::Undefined) };
        Self { entries: vec![empty; ENTRIES].into_boxed_slice(), generation: 1, decoded: Box::new([0; PAGES / 64]) }
    }

    #[inline(always)]
    pub fn get(&self, address: u32) -> Option<Instruction> {
        let entry = &self.entries[slot(address)];
        (entry.address == address && entry.generation == self.generation).then_some(entry.instruction)
    }

    pub fn insert(&mut self, address: u32, instruction: Instruction) {
        self.entries[slot(address)] = Entry { address, generation: self.generation, instruction };
        self.mark(address);
        self.mark(address.wrapping_add(2));
    }

    fn mark(&mut self, address: u32) {
        let page = page(address);
        self.decoded[page / 64] |= 1 << (page % 64);
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        *self.decoded = [0; PAGES / 64];
        self.generation = self.generation.wrapping_add(1);
        if self.generation == 0 {
            *self = Self::new();
        }
    }

    /// Forgets what an aligned store of up to four bytes at `address` may have changed.
    #[inline(always)]
    pub fn written(&mut self, address: u32) {
        let page = page(address);
        if self.decoded[page / 64] >> (page % 64) & 1 != 0 {
            self.forget_around(address);
        }
    }

    #[cold]
    fn forget_around(&mut self, address: u32) {
        let first = (address & !1).wrapping_sub(2);
        for half in 0..3 {
            let entry = &mut self.entries[slot(first.wrapping_add(2 * half))];
            entry.generation = 0;
        }
    }
}

#[inline(always)]
const fn slot(address: u32) -> usize {
    (address >> 1) as usize % ENTRIES
}

#[inline(always)]
const fn page(address: u32) -> usize {
    (address >> 10) as usize % PAGES
}
