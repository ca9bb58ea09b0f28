//! Flash, boot loader and trusted key, with the interface of the node.

use embassy_boot_stm32::State;
use embassy_stm32::{Peri, peripherals};
use vergence_control::{BoardServices, Flash, FlashError, UNIT};
use vergence_image::layout::{ACTIVE, CAPACITY, DFU, PAGE, Region, SETTINGS, pages_to_swap};
use vergence_image::{Seal, is_signed_by};
use vergence_protocol::management::{BootState, ImageHeader, Signature};

use crate::flash::{Area, FedFlash, feed_watchdog};
use crate::key::trusted_key;
use crate::memory;
use crate::swap::SwapState;

/// Flash of an image that is being received, and of its seal before it.
const SEAL: Region = Region { start: DFU.start, length: PAGE };
const RECEIVED: Region = Region { start: SEAL.end(), length: CAPACITY };
/// Flash in which a swap leaves the earlier image and its seal: one page above [`DFU`]'s start.
const EARLIER: Region = Region { start: DFU.start + PAGE, length: ACTIVE.length };

/// The board's flash, boot loader and key.
pub struct Services {
    settings: Area,
    image: Area,
    seal: Area,
    swap: SwapState,
    boot: BootState,
    leaves_settings: bool,
}

impl Services {
    /// Services of an application: the boot loader's state page tells which image runs. With `leaves_settings` the saved
    /// settings are left aside at this start.
    pub fn of_application(flash: &Peri<'static, peripherals::FLASH>, leaves_settings: bool) -> Self {
        let mut services = Self::new(flash, BootState::Confirmed);
        services.boot = match services.swap.read() {
            State::Swap => BootState::Trial,
            State::Revert => BootState::Reverted,
            State::Boot | State::DfuDetach => BootState::Confirmed,
        };
        services.leaves_settings = leaves_settings;
        services
    }

    /// Services of the boot loader's recovery.
    pub fn of_recovery(flash: &Peri<'static, peripherals::FLASH>) -> Self {
        Self::new(flash, BootState::Recovery)
    }

    #[allow(unsafe_code, reason = "several handles of one flash")]
    fn new(flash: &Peri<'static, peripherals::FLASH>, boot: BootState) -> Self {
        // SAFETY: as for `Area::new`.
        let whole = FedFlash::new(unsafe { flash.clone_unchecked() });
        let [settings, image, seal] = [SETTINGS, RECEIVED, SEAL].map(|region| Area::new(flash, region));
        Self { settings, image, seal, swap: SwapState::new(whole), boot, leaves_settings: false }
    }
}

impl BoardServices for Services {
    fn settings_flash(&mut self) -> &mut impl Flash {
        &mut self.settings
    }

    fn image_flash(&mut self) -> &mut impl Flash {
        &mut self.image
    }

    fn leaves_settings(&self) -> bool {
        self.leaves_settings
    }

    fn boot_state(&self) -> BootState {
        self.boot
    }

    fn trusts(&self, signed: &[u8; ImageHeader::SIGNED], signature: &Signature) -> bool {
        feed_watchdog();
        is_signed_by(trusted_key(), signed, signature)
    }

    fn trusted_key(&self) -> [u8; 32] {
        *trusted_key()
    }

    fn schedule_trial(&mut self, image: &ImageHeader, signature: &Signature) -> Result<(), FlashError> {
        let seal = Seal { header: *image, signature: *signature }.to_bytes();
        self.seal.erase(0)?;
        for (index, unit) in seal.as_chunks::<UNIT>().0.iter().enumerate() {
            self.seal.program(index * UNIT, *unit)?;
        }
        self.swap.mark_updated(pages_to_swap(image.length, installed_length()))
    }

    fn confirm(&mut self) -> Result<(), FlashError> {
        self.swap.mark_booted()?;
        self.boot = BootState::Confirmed;
        Ok(())
    }

    fn roll_back(&mut self) -> Result<bool, FlashError> {
        if self.boot == BootState::Trial {
            // Every start without confirmation returns to the earlier image.
            return Ok(true);
        }
        feed_watchdog();
        let Ok(earlier) = Seal::check(memory::region(EARLIER), trusted_key()) else { return Ok(false) };
        self.swap.mark_undone(pages_to_swap(earlier.header.length, installed_length()))?;
        Ok(true)
    }
}

/// Length in bytes of the installed image; zero where it has no seal, because nothing can return to it then.
fn installed_length() -> u32 {
    let seal = memory::region(ACTIVE).first_chunk().and_then(|seal| Seal::from_bytes(seal).ok());
    seal.map_or(0, |seal| seal.header.length)
}
