//! What the native board has besides its mechanics: flash and a boot loader.

use vergence_control::{BoardServices, Flash, FlashError};
use vergence_protocol::management::{BootState, ImageHeader, Signature};

use crate::flash::RamFlash;

/// Pages of the settings.
const SETTINGS_PAGES: usize = 2;
/// Pages for an image: 96 KiB.
const IMAGE_PAGES: usize = 48;

/// Whether a signature over the bytes is of a trusted key.
pub type Verifier = fn(&[u8; ImageHeader::SIGNED], &Signature) -> bool;

/// Flash and boot loader in RAM. They outlive a restart of the board.
#[derive(Clone, Debug)]
pub struct NativeServices {
    /// Where the settings are kept.
    pub settings: RamFlash,
    /// Where a new image is stored.
    pub image: RamFlash,
    /// What runs.
    pub boot_state: BootState,
    /// What the boot loader was told to start next, where it was told.
    pub next_boot: Option<BootState>,
    /// Whether there is an image before the running one.
    pub has_earlier: bool,
    /// Which signatures are trusted.
    pub verifier: Verifier,
}

impl Default for NativeServices {
    /// Empty flash, a confirmed application, no trusted key.
    fn default() -> Self {
        Self {
            settings: RamFlash::new(SETTINGS_PAGES),
            image: RamFlash::new(IMAGE_PAGES),
            boot_state: BootState::Confirmed,
            next_boot: None,
            has_earlier: false,
            verifier: |_, _| false,
        }
    }
}

impl NativeServices {
    /// What the boot loader does at a start: a scheduled image goes on trial, one that was not confirmed goes back.
    pub fn boot(&mut self) {
        self.boot_state = match (self.next_boot.take(), self.boot_state) {
            (Some(next), _) => next,
            (None, BootState::Trial) => BootState::Reverted,
            (None, running) => running,
        };
        self.has_earlier |= self.boot_state == BootState::Trial;
    }
}

impl BoardServices for NativeServices {
    fn settings_flash(&mut self) -> &mut impl Flash {
        &mut self.settings
    }

    fn image_flash(&mut self) -> &mut impl Flash {
        &mut self.image
    }

    fn boot_state(&self) -> BootState {
        self.boot_state
    }

    fn trusts(&self, signed: &[u8; ImageHeader::SIGNED], signature: &Signature) -> bool {
        (self.verifier)(signed, signature)
    }

    fn schedule_trial(&mut self) -> Result<(), FlashError> {
        self.next_boot = Some(BootState::Trial);
        Ok(())
    }

    fn confirm(&mut self) -> Result<(), FlashError> {
        self.boot_state = BootState::Confirmed;
        self.has_earlier = true;
        Ok(())
    }

    fn roll_back(&mut self) -> Result<bool, FlashError> {
        if self.has_earlier {
            self.next_boot = Some(BootState::Reverted);
        }
        Ok(self.has_earlier)
    }
}
