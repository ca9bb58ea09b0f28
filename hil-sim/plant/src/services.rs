//! Flash and boot loader of the native board.

use vergence_control::{BoardServices, Flash, FlashError};
use vergence_protocol::management::{BootState, ImageHeader, Signature};

use crate::flash::RamFlash;

/// Number of flash pages for the settings.
const SETTINGS_PAGES: usize = 2;
/// Number of flash pages for an image: 184 KiB, as on the NUCLEO-G474RE.
const IMAGE_PAGES: usize = 92;

/// Checks whether a signature of the bytes was made with a key.
pub type Verifier = fn(&[u8; 32], &[u8; ImageHeader::SIGNED], &Signature) -> bool;

/// The properties of an image that the simulation needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Firmware {
    /// Version of the image.
    pub version: [u8; 3],
    /// Build of the image.
    pub build: u64,
}

/// Flash and boot loader in RAM, kept through restarts of the board.
#[derive(Clone, Debug)]
pub struct NativeServices {
    /// Flash of the settings.
    pub settings: RamFlash,
    /// Flash of a new image.
    pub image: RamFlash,
    /// The image that runs, by name only: the code is always this program.
    pub running: Firmware,
    /// State in which the boot loader started the program.
    pub boot_state: BootState,
    /// The oldest version accepted.
    pub oldest: [u8; 3],
    /// The key whose signatures are trusted.
    pub key: [u8; 32],
    /// The check of signatures by that key.
    pub verifier: Verifier,
    earlier: Option<Firmware>,
    scheduled: Option<Firmware>,
    goes_back: bool,
}

impl Default for NativeServices {
    /// Empty flash, a confirmed application, no trusted key.
    fn default() -> Self {
        Self {
            settings: RamFlash::new(SETTINGS_PAGES),
            image: RamFlash::new(IMAGE_PAGES),
            running: Firmware { version: workspace_version(), build: 0 },
            boot_state: BootState::Confirmed,
            oldest: [0, 0, 0],
            key: [0; 32],
            verifier: |_, _, _| false,
            earlier: None,
            scheduled: None,
            goes_back: false,
        }
    }
}

impl NativeServices {
    /// Does what the boot loader does at a start: puts a scheduled image on trial, and reverts one that was not
    /// confirmed.
    pub fn boot(&mut self) {
        let goes_back = std::mem::take(&mut self.goes_back) || self.boot_state == BootState::Trial;
        if let Some(new) = self.scheduled.take() {
            self.earlier = Some(std::mem::replace(&mut self.running, new));
            self.boot_state = BootState::Trial;
        } else if let Some(earlier) = self.earlier.take_if(|_| goes_back) {
            self.running = earlier;
            self.boot_state = BootState::Reverted;
        }
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
        (self.verifier)(&self.key, signed, signature)
    }

    fn trusted_key(&self) -> [u8; 32] {
        self.key
    }

    fn schedule_trial(&mut self, image: &ImageHeader, _signature: &Signature) -> Result<(), FlashError> {
        self.scheduled = Some(Firmware { version: image.version, build: image.build });
        Ok(())
    }

    fn confirm(&mut self) -> Result<(), FlashError> {
        self.boot_state = BootState::Confirmed;
        Ok(())
    }

    fn roll_back(&mut self) -> Result<bool, FlashError> {
        self.goes_back = self.earlier.is_some();
        Ok(self.goes_back)
    }
}

/// The native board runs its own sources.
fn workspace_version() -> [u8; 3] {
    let part = |text: &str| text.parse().unwrap_or(0);
    [
        part(env!("CARGO_PKG_VERSION_MAJOR")),
        part(env!("CARGO_PKG_VERSION_MINOR")),
        part(env!("CARGO_PKG_VERSION_PATCH")),
    ]
}
