//! What boot loader and application tell each other in the state page of embassy-boot 0.7.
//!
//! Word 0 is the state; word 1, once written, makes the progress invalid; the words from 2 on are written one by one as
//! pages are copied: two for each page of a swap, then two for each page of its undoing. A swap that is complete but
//! whose state is not set to "booted" is undone at the next start.

use core::cell::RefCell;

use embassy_boot_stm32::{BlockingFirmwareState, BootLoader, BootLoaderConfig, State};
use embassy_embedded_hal::flash::partition::BlockingPartition;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embedded_storage::nor_flash::NorFlash;
use vergence_control::FlashError;
use vergence_image::layout::{ACTIVE, DFU, PAGE, Region, STATE, WORD};

use crate::flash::FedFlash;

/// A word of the state "swap", and one of progress.
const SWAP: [u8; WORD as usize] = [0xF0; WORD as usize];
const DONE: [u8; WORD as usize] = [0; WORD as usize];

type Shared<'a> = Mutex<NoopRawMutex, RefCell<&'a mut FedFlash>>;
type Part<'a> = BlockingPartition<'a, NoopRawMutex, &'a mut FedFlash>;

/// The state page, and the two images it is about.
pub struct SwapState(FedFlash);

impl SwapState {
    /// The state page of this flash.
    pub const fn new(flash: FedFlash) -> Self {
        Self(flash)
    }

    /// Begins, goes on with or undoes a swap, if one is due. Returns how the state was found.
    pub fn carry_out(&mut self) -> State {
        let flash = Shared::new(RefCell::new(&mut self.0));
        let config =
            BootLoaderConfig { active: part(&flash, ACTIVE), dfu: part(&flash, DFU), state: part(&flash, STATE) };
        // It fails only where flash does; what is there may still be sound.
        BootLoader::try_prepare::<_, _, _, { PAGE as usize }>(config).map_or(State::Boot, |loader| loader.state)
    }

    /// The state.
    pub fn read(&mut self) -> State {
        self.state(|state| state.get_state()).unwrap_or(State::Boot)
    }

    /// The image in [`DFU`] is to be swapped in at the next start.
    pub fn mark_updated(&mut self) -> Result<(), FlashError> {
        self.state(|state| state.mark_updated())
    }

    /// The image that runs is good.
    pub fn mark_booted(&mut self) -> Result<(), FlashError> {
        self.state(|state| state.mark_booted())
    }

    /// The last swap is to be undone at the next start, though it was found good: writes the state as it was right after
    /// that swap. The state itself comes last, so that a cut leaves a state that means nothing.
    pub fn mark_undone(&mut self) -> Result<(), FlashError> {
        let words_of_swap = ACTIVE.length / PAGE * 2;
        let mut write = || {
            self.0.erase(STATE.start, STATE.end())?;
            for word in 2..2 + words_of_swap {
                self.0.write(STATE.start + word * WORD, &DONE)?;
            }
            self.0.write(STATE.start, &SWAP)
        };
        write().map_err(|_| FlashError)
    }

    fn state<R, E>(
        &mut self,
        act: impl FnOnce(&mut BlockingFirmwareState<'_, Part<'_>>) -> Result<R, E>,
    ) -> Result<R, FlashError> {
        let flash = Shared::new(RefCell::new(&mut self.0));
        let mut word = [0; WORD as usize];
        act(&mut BlockingFirmwareState::new(part(&flash, STATE), &mut word)).map_err(|_| FlashError)
    }
}

fn part<'a>(flash: &'a Shared<'a>, region: Region) -> Part<'a> {
    BlockingPartition::new(flash, region.start, region.length)
}
