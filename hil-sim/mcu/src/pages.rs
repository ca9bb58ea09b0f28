//! Which pages of flash a program depends on.

use std::cell::Cell;

use crate::flash::PAGE;
use crate::memory::FLASH_SIZE;

const WORDS: usize = FLASH_SIZE / PAGE / 64;

/// Pages that were read, executed or programmed before the program erased them itself. The contents of the others do
/// not affect the run.
#[derive(Clone, Debug, Default)]
pub(crate) struct PageUse {
    used: [Cell<u64>; WORDS],
    erased: [u64; WORDS],
}

impl PageUse {
    /// Records a use of the page that contains this byte.
    pub fn note(&self, offset: usize) {
        let (word, bit) = place(offset);
        self.used[word].set(self.used[word].get() | bit & !self.erased[word]);
    }

    /// Records that the page of this byte is erased.
    pub fn erase(&mut self, offset: usize) {
        let (word, bit) = place(offset);
        self.erased[word] |= bit;
    }

    /// The pages used, by number.
    pub fn pages(&self) -> Vec<usize> {
        let is_used = |page: &usize| self.used[page / 64].get() >> (page % 64) & 1 == 1;
        (0..FLASH_SIZE / PAGE).filter(is_used).collect()
    }
}

const fn place(offset: usize) -> (usize, u64) {
    let page = offset / PAGE;
    (page / 64, 1 << (page % 64))
}
