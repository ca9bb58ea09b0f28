//! Decoded instructions, kept per half-word of code.

use crate::instruction::{Instruction, Op};

/// Half-words that fit at once: 128 KiB of straight code, more than a controller's image.
const ENTRIES: usize = 1 << 16;
/// An address beyond the bits that choose its entry.
const TAG_SHIFT: u32 = 17;
/// Stores look here first: one bit for each 1 KiB page, folded, in which something was decoded.
const PAGES: usize = 4096;

#[derive(Clone, Copy)]
struct Entry {
    /// Upper bits of the address, and above them the generation; zero is neither.
    tag: u32,
    instruction: Instruction,
}

/// A direct-mapped table from code address to decoded instruction.
#[derive(Clone)]
pub(crate) struct Cache {
    /// Lent to the loop that runs instructions, which borrows them from here while it changes the core.
    entries: Option<Entries>,
    /// Where a tag holds it; entries of others are forgotten.
    generation: u32,
    decoded: Box<[u64; PAGES / 64]>,
    /// Stores over code since the table was lent.
    stale: Vec<u32>,
    /// The generations began anew since the table was lent: its tags mean nothing any more.
    outworn: bool,
}

impl Cache {
    /// The first generation, and the distance to the next.
    const GENERATION: u32 = 1 << (32 - TAG_SHIFT);

    pub fn new() -> Self {
        let decoded = Box::new([0; PAGES / 64]);
        Self { entries: None, generation: Self::GENERATION, decoded, stale: Vec::new(), outworn: false }
    }

    /// The table, to be given back.
    pub fn lend(&mut self) -> Entries {
        self.entries.take().unwrap_or_else(Entries::empty)
    }

    /// The table is back, and forgets what was written over.
    pub fn take_back(&mut self, mut entries: Entries) {
        if std::mem::take(&mut self.outworn) {
            self.stale.clear();
            return;
        }
        for address in std::mem::take(&mut self.stale) {
            entries.forget_around(address, self.generation);
        }
        self.entries = Some(entries);
    }

    #[inline(always)]
    pub const fn generation(&self) -> u32 {
        self.generation
    }

    /// An instruction at `address` was decoded.
    pub fn mark(&mut self, address: u32) {
        for half in [address, address.wrapping_add(2)] {
            let page = page(half);
            self.decoded[page / 64] |= 1 << (page % 64);
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        *self.decoded = [0; PAGES / 64];
        self.generation = self.generation.wrapping_add(Self::GENERATION);
        if self.generation == 0 {
            self.generation = Self::GENERATION;
            self.outworn = self.entries.take().is_none();
        }
    }

    /// Whether a store at `address` may change something decoded; then the loop must give the table back.
    #[inline(always)]
    pub fn written(&mut self, address: u32) -> bool {
        let page = page(address);
        let hit = self.decoded[page / 64] >> (page % 64) & 1 != 0;
        if hit {
            self.note_stale(address);
        }
        hit
    }

    #[cold]
    fn note_stale(&mut self, address: u32) {
        match &mut self.entries {
            Some(entries) => entries.forget_around(address, self.generation),
            None => self.stale.push(address),
        }
    }
}

/// The entries, by the low bits of their addresses.
#[derive(Clone)]
pub(crate) struct Entries(Box<[Entry; ENTRIES]>);

impl Entries {
    /// On the heap from the beginning: it is too large for a stack.
    fn empty() -> Self {
        let empty = Entry { tag: 0, instruction: Instruction::new(Op::Undefined) };
        match vec![empty; ENTRIES].into_boxed_slice().try_into() {
            Ok(entries) => Self(entries),
            Err(_) => unreachable!("it has this length"),
        }
    }

    #[inline(always)]
    pub fn get(&self, address: u32, generation: u32) -> Option<&Instruction> {
        let entry = &self.0[slot(address)];
        (entry.tag == tag(address, generation)).then_some(&entry.instruction)
    }

    pub fn insert(&mut self, address: u32, generation: u32, instruction: Instruction) -> &Instruction {
        let entry = &mut self.0[slot(address)];
        *entry = Entry { tag: tag(address, generation), instruction };
        &entry.instruction
    }

    /// Forgets what an aligned store of up to four bytes may have changed.
    fn forget_around(&mut self, address: u32, generation: u32) {
        let first = (address & !1).wrapping_sub(2);
        for half in 0..3 {
            let at = first.wrapping_add(2 * half);
            let entry = &mut self.0[slot(at)];
            if entry.tag == tag(at, generation) {
                entry.tag = 0;
            }
        }
    }
}

#[inline(always)]
const fn tag(address: u32, generation: u32) -> u32 {
    address >> TAG_SHIFT | generation
}

#[inline(always)]
const fn slot(address: u32) -> usize {
    (address >> 1) as usize % ENTRIES
}

/// The upper bits keep memories apart that begin at round addresses.
#[inline(always)]
const fn page(address: u32) -> usize {
    (address >> 10 ^ address >> 18) as usize % PAGES
}
