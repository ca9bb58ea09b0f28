//! Decoded instructions, kept per half-word of code.

use crate::instruction::{Instruction, Op};

/// Number of half-words that the table holds: 128 KiB of straight code, more than a controller's image.
const ENTRIES: usize = 1 << 16;
/// How far an address is shifted to leave the tag: the bits that do not choose its entry.
const TAG_SHIFT: u32 = 17;
/// One bit for each 1 KiB page, folded, in which an instruction was decoded: stores look here first.
const PAGES: usize = 4096;

#[derive(Clone, Copy)]
struct Entry {
    /// Upper bits of the address, and above them the generation; zero where the entry is empty.
    tag: u32,
    instruction: Instruction,
}

/// A direct-mapped table from code address to decoded instruction.
#[derive(Clone)]
pub(crate) struct Cache {
    /// The entries, which the loop that runs instructions takes away while it changes the core.
    entries: Option<Entries>,
    /// The present generation: entries whose tags hold another one are invalid.
    generation: u32,
    decoded: Box<[u64; PAGES / 64]>,
    /// Addresses of stores over code since the table was lent.
    stale: Vec<u32>,
    /// Whether the generations began anew since the table was lent: its tags are invalid then.
    outworn: bool,
}

impl Cache {
    /// The first generation, and the distance from one to the next.
    const GENERATION: u32 = 1 << (32 - TAG_SHIFT);

    pub fn new() -> Self {
        let decoded = Box::new([0; PAGES / 64]);
        Self { entries: None, generation: Self::GENERATION, decoded, stale: Vec::new(), outworn: false }
    }

    /// Takes the table, which must be given back.
    pub fn lend(&mut self) -> Entries {
        self.entries.take().unwrap_or_else(Entries::empty)
    }

    /// Gives the table back, and drops the entries whose code was written over.
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

    /// Records that an instruction at `address` was decoded.
    pub fn mark(&mut self, address: u32) {
        for half in [address, address.wrapping_add(2)] {
            let page = page(half);
            self.decoded[page / 64] |= 1 << (page % 64);
        }
    }

    /// Drops every entry.
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

    /// Drops the entries that an aligned store of up to four bytes may have changed.
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

/// Mixes in the upper bits, which keep memories apart that begin at round addresses.
#[inline(always)]
const fn page(address: u32) -> usize {
    (address >> 10 ^ address >> 18) as usize % PAGES
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: u32 = 0x0800_0100;

    fn with_a_nop() -> Cache {
        let mut cache = Cache::new();
        let mut entries = cache.lend();
        entries.insert(AT, cache.generation(), Instruction::new(Op::Nop));
        cache.mark(AT);
        cache.take_back(entries);
        cache
    }

    fn knows(cache: &mut Cache) -> bool {
        let entries = cache.lend();
        let known = entries.get(AT, cache.generation()).is_some();
        cache.take_back(entries);
        known
    }

    #[test]
    fn a_store_is_noticed_while_the_table_is_lent_too() {
        let mut cache = with_a_nop();
        assert!(!cache.written(AT + 0x2000) && knows(&mut cache));
        assert!(cache.written(AT) && !knows(&mut cache));
        let mut cache = with_a_nop();
        let entries = cache.lend();
        assert!(cache.written(AT));
        cache.take_back(entries);
        assert!(!knows(&mut cache));
    }

    #[test]
    fn old_code_never_comes_back_when_generations_begin_anew() {
        // Zero is left out.
        let generations = u32::MAX / Cache::GENERATION;
        for lent in [false, true] {
            let mut cache = with_a_nop();
            let first = cache.generation();
            let entries = lent.then(|| cache.lend());
            for _ in 0..generations {
                cache.clear();
            }
            assert_eq!(cache.generation(), first);
            entries.into_iter().for_each(|entries| cache.take_back(entries));
            assert!(!knows(&mut cache));
        }
    }
}
