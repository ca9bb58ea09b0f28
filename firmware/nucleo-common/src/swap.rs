//! The state pages of embassy-boot 0.7, by which boot loader and application tell each other about a swap of images.
//!
//! Word 0 is the state; word 1, once written, makes the progress invalid; the words from 2 on are written one by one as
//! pages are copied: two for each page of a swap, then two for each page of its undoing. A swap that is complete but
//! whose state is not set to "booted" is undone at the next start. The last word holds the number of pages of the swap:
//! embassy-boot gets two partitions of that length, so that a short image is swapped in a short time.
//!
//! A power cut during an erasure may leave the state and erase the progress: a complete swap would then look like one
//! that has just begun and be carried out again over its own result. So the state's word is made meaningless before the
//! page is erased: zeros may be programmed over anything (RM0440, 3.3.7).

use core::cell::RefCell;

use embassy_boot_stm32::{BootLoader, BootLoaderConfig, State};
use embassy_embedded_hal::flash::partition::BlockingPartition;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use vergence_control::FlashError;
use vergence_image::layout::{ACTIVE, DFU, PAGE, Region, STATE, WORD};

use crate::flash::FedFlash;

type Word = [u8; WORD as usize];

/// State words as embassy-boot writes them, and a word of progress, which means no state.
const BOOTED: Word = [0xD0; WORD as usize];
const SWAP: Word = [0xF0; WORD as usize];
const DONE: Word = [0; WORD as usize];

/// Offset in flash of the word with the number of pages.
const PAGES: u32 = STATE.end() - WORD;

/// Length of a swap in pages, and how many of its words of progress are written.
struct Swap {
    pages: u32,
    done: u32,
}

type Shared<'a> = Mutex<NoopRawMutex, RefCell<&'a mut FedFlash>>;
type Part<'a> = BlockingPartition<'a, NoopRawMutex, &'a mut FedFlash>;

/// The state pages, and the two images they are about.
pub struct SwapState(FedFlash);

impl SwapState {
    /// The state pages of this flash.
    pub const fn new(flash: FedFlash) -> Self {
        Self(flash)
    }

    /// Begins, resumes or undoes a swap, if one is due. Returns the state found before.
    pub fn carry_out(&mut self) -> State {
        let pages = self.pages();
        let flash = Shared::new(RefCell::new(&mut self.0));
        let state = StatePage(part(&flash, STATE));
        let active = part(&flash, Region { length: pages * PAGE, ..ACTIVE });
        let dfu = part(&flash, Region { length: (pages + 1) * PAGE, ..DFU });
        let config = BootLoaderConfig { active, dfu, state };
        // Only a failing flash makes this fail; the image may still be sound.
        BootLoader::try_prepare::<_, _, _, { PAGE as usize }>(config).map_or(State::Boot, |loader| loader.state)
    }

    /// Reads the state.
    pub fn read(&mut self) -> State {
        let mut word = DONE;
        match self.0.read(STATE.start, &mut word) {
            Ok(()) => State::from(word),
            Err(_) => State::Boot,
        }
    }

    /// Number of pages of the swap; all, where no swap is due.
    fn pages(&mut self) -> u32 {
        const ALL: u32 = ACTIVE.length / PAGE;
        let mut word = DONE;
        let read = self.read() == State::Swap && self.0.read(PAGES, &mut word).is_ok();
        let pages = u64::from_le_bytes(word);
        u32::try_from(pages).ok().filter(|pages| read && (1..=ALL).contains(pages)).unwrap_or(ALL)
    }

    /// Orders a swap of `pages` pages with [`DFU`] at the next start.
    pub fn mark_updated(&mut self, pages: u32) -> Result<(), FlashError> {
        if self.read() == State::Swap { Ok(()) } else { self.enter(SWAP, Swap { pages, done: 0 }) }
    }

    /// Marks the running image as good.
    pub fn mark_booted(&mut self) -> Result<(), FlashError> {
        self.enter(BOOTED, Swap { pages: 0, done: 0 })
    }

    /// Orders the undoing of the last swap, of `pages` pages, at the next start, although its image was marked as good: writes
    /// the state as it was right after that swap.
    pub fn mark_undone(&mut self, pages: u32) -> Result<(), FlashError> {
        self.enter(SWAP, Swap { pages, done: pages * 2 })
    }

    /// Ends the state and begins another with this swap. The new state is written last: until then there is none.
    fn enter(&mut self, state: Word, swap: Swap) -> Result<(), FlashError> {
        let mut write = || {
            self.0.write(STATE.start, &DONE)?;
            self.0.erase(STATE.start, STATE.end())?;
            for word in 2..2 + swap.done {
                self.0.write(STATE.start + word * WORD, &DONE)?;
            }
            self.0.write(PAGES, &u64::from(swap.pages).to_le_bytes())?;
            self.0.write(STATE.start, &state)
        };
        write().map_err(|_| FlashError)
    }
}

/// The state page for embassy-boot's own changes of state.
struct StatePage<'a>(Part<'a>);

impl ErrorType for StatePage<'_> {
    type Error = <Part<'static> as ErrorType>::Error;
}

impl ReadNorFlash for StatePage<'_> {
    const READ_SIZE: usize = <Part<'static> as ReadNorFlash>::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for StatePage<'_> {
    const WRITE_SIZE: usize = <Part<'static> as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = <Part<'static> as NorFlash>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        // It ends a state by making its progress invalid.
        if offset == WORD {
            self.0.write(0, &DONE)?;
        }
        self.0.write(offset, bytes)
    }
}

fn part<'a>(flash: &'a Shared<'a>, region: Region) -> Part<'a> {
    BlockingPartition::new(flash, region.start, region.length)
}
