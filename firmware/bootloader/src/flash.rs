//! Flash that feeds the watchdog: a swap takes seconds, and each page of it is progress.

use core::cell::RefCell;

use embassy_boot_stm32::{BootLoader, BootLoaderConfig, State};
use embassy_embedded_hal::flash::partition::BlockingPartition;
use embassy_stm32::flash::{self, Blocking, Flash};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, peripherals};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use vergence_image::layout::{ACTIVE, DFU, PAGE, Region, STATE};

/// The whole flash.
pub struct FedFlash {
    flash: Flash<'static, Blocking>,
    watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
}

impl FedFlash {
    /// Flash and the watchdog that bites when it hangs.
    pub fn new(
        flash: Peri<'static, peripherals::FLASH>,
        watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
    ) -> Self {
        Self { flash: Flash::new_blocking(flash), watchdog }
    }

    /// Begins, goes on with or undoes a swap, if one is due. Returns how the state was found.
    pub fn swap(self) -> State {
        let flash = Mutex::<NoopRawMutex, _>::new(RefCell::new(self));
        let part = |region: Region| BlockingPartition::new(&flash, region.start, region.length);
        let config = BootLoaderConfig { active: part(ACTIVE), dfu: part(DFU), state: part(STATE) };
        // It fails only where flash does; what is there may still be sound.
        BootLoader::try_prepare::<_, _, _, { PAGE as usize }>(config).map_or(State::Boot, |loader| loader.state)
    }
}

impl ErrorType for FedFlash {
    type Error = flash::Error;
}

impl ReadNorFlash for FedFlash {
    const READ_SIZE: usize = <Flash<'static, Blocking> as ReadNorFlash>::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.flash.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        ReadNorFlash::capacity(&self.flash)
    }
}

impl NorFlash for FedFlash {
    const WRITE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.watchdog.pet();
        self.flash.blocking_erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.watchdog.pet();
        self.flash.blocking_write(offset, bytes)
    }
}
