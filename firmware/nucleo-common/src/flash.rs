//! The flash: as a whole for the swap, in areas for settings and images. Each operation feeds the watchdog, for each is
//! progress; one that never ended would starve it.

use embassy_stm32::flash::{Blocking, Error, Flash};
use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::{Peri, peripherals};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use vergence_control::{FlashError, PAGE, UNIT};
use vergence_image::layout::Region;

use crate::ecc;

/// Feeds the watchdog, whoever started it.
pub fn feed_watchdog() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// The whole flash.
pub struct FedFlash(Flash<'static, Blocking>);

impl FedFlash {
    /// The flash, if it has two banks as this program expects; else it panics, for nothing could be written rightly.
    pub fn new(flash: Peri<'static, peripherals::FLASH>) -> Self {
        Self(Flash::new_blocking(flash))
    }
}

impl ErrorType for FedFlash {
    type Error = Error;
}

impl ReadNorFlash for FedFlash {
    const READ_SIZE: usize = <Flash<'static, Blocking> as ReadNorFlash>::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        ReadNorFlash::capacity(&self.0)
    }
}

impl NorFlash for FedFlash {
    const WRITE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        feed_watchdog();
        self.0.blocking_erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        feed_watchdog();
        self.0.blocking_write(offset, bytes)
    }
}

/// A region of the flash, as the controller sees it.
pub struct Area {
    flash: FedFlash,
    region: Region,
}

impl Area {
    /// The region of a flash of its own: the driver has no state, and calls block, so several may stand side by side as
    /// long as none is used from within another.
    #[allow(unsafe_code, reason = "several handles of one flash")]
    pub fn new(flash: &Peri<'static, peripherals::FLASH>, region: Region) -> Self {
        // SAFETY: see above; all areas belong to one `Services`, whose methods take it whole.
        Self { flash: FedFlash::new(unsafe { flash.clone_unchecked() }), region }
    }

    /// The offset in flash of `length` bytes from byte `at` of the area on.
    fn place(&self, at: usize, length: usize) -> Result<u32, FlashError> {
        let [at, length] = [at, length].map(|value| u32::try_from(value).unwrap_or(u32::MAX));
        let inside = at.checked_add(length).is_some_and(|end| end <= self.region.length);
        if inside { Ok(self.region.start + at) } else { Err(FlashError) }
    }
}

impl vergence_control::Flash for Area {
    fn pages(&self) -> usize {
        self.region.length as usize / PAGE
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        let from = self.place(page * PAGE, PAGE)?;
        self.flash.erase(from, from + PAGE as u32).map_err(|_| FlashError)
    }

    fn program(&mut self, at: usize, unit: [u8; UNIT]) -> Result<(), FlashError> {
        let place = self.place(at, UNIT)?;
        self.flash.write(place, &unit).map_err(|_| FlashError)
    }

    fn read(&mut self, at: usize, into: &mut [u8]) -> Result<(), FlashError> {
        let place = self.place(at, into.len())?;
        match ecc::guarded(|| self.flash.read(place, into)) {
            Some(Ok(())) => Ok(()),
            _ => Err(FlashError),
        }
    }
}
