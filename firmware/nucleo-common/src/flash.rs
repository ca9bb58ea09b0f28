//! The flash: as a whole for the swap, in areas for settings and images.
//!
//! Each operation feeds the watchdog, because each is progress; an operation that never ended would starve it.
//!
//! A word that a power cut tore while it was programmed or erased raises the non-maskable interrupt whenever it is read,
//! until a flag is cleared (RM0440, 3.3.4). That is no reason to stop: swap, settings and update can go on from any
//! content.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;
use embassy_stm32::flash::{Blocking, Error, Flash};
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::pac::{FLASH, IWDG};
use embassy_stm32::{Peri, peripherals};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use vergence_control::{FlashError, PAGE, UNIT};
use vergence_image::layout::Region;

/// Feeds the watchdog, if it runs.
pub fn feed_watchdog() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// The whole flash; its operations feed the watchdog.
pub struct FedFlash(Flash<'static, Blocking>);

impl FedFlash {
    /// Takes the flash. Panics if the flash does not have two banks, because nothing could be written correctly then.
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

/// A region of the flash, with the interface of the controller.
pub struct Area {
    flash: FedFlash,
    region: Region,
}

impl Area {
    /// A region with a handle of its own on the flash: the driver has no state and calls block, so several handles may
    /// exist as long as none is used from within another's call.
    #[allow(unsafe_code, reason = "several handles of one flash")]
    pub fn new(flash: &Peri<'static, peripherals::FLASH>, region: Region) -> Self {
        // SAFETY: see above; all areas belong to one `Services`, whose methods take it whole.
        Self { flash: FedFlash::new(unsafe { flash.clone_unchecked() }), region }
    }

    /// Offset in flash of the `length` bytes from byte `at` of the area on.
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
        match guarded(|| self.flash.read(place, into)) {
            Some(Ok(())) => Ok(()),
            _ => Err(FlashError),
        }
    }
}

/// Set by the non-maskable interrupt when a torn word was read.
static TORN: AtomicBool = AtomicBool::new(false);

/// Runs `read`; returns `None` if it met a torn word.
fn guarded<R>(read: impl FnOnce() -> R) -> Option<R> {
    TORN.store(false, Ordering::SeqCst);
    let result = read();
    (!TORN.load(Ordering::SeqCst)).then_some(result)
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it clears one flag of the flash and sets one atomic.
#[exception]
unsafe fn NonMaskableInt() {
    FLASH.eccr().modify(|w| w.set_eccd(true));
    TORN.store(true, Ordering::SeqCst);
}
