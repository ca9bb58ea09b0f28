//! The interface between the node and a board's flash, boot loader and trusted key.

use vergence_protocol::management::{BootState, ImageHeader, Signature};

/// Bytes of a page, the smallest part of the flash that can be erased (STM32G4 with two banks, ST RM0440 section 3.3.1).
pub const PAGE: usize = 2048;
/// Bytes of a unit, the part of the flash that is programmed at once (ST RM0440 section 3.3.1).
pub const UNIT: usize = 8;

/// The flash did not erase, program or read as told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the flash failed")]
pub struct FlashError;

/// An area of flash. Calls block: erasing a page takes some 20 ms, so nothing may move meanwhile.
pub trait Flash {
    /// Number of pages of the area.
    fn pages(&self) -> usize;
    /// Sets all bytes of a page to 0xFF.
    ///
    /// # Errors
    /// [`FlashError`]; the page may then hold anything.
    fn erase(&mut self, page: usize) -> Result<(), FlashError>;
    /// Programs the unit at byte `at`, a multiple of [`UNIT`], which must have been erased and not programmed since.
    ///
    /// # Errors
    /// [`FlashError`]; the unit may then hold anything.
    fn program(&mut self, at: usize, unit: [u8; UNIT]) -> Result<(), FlashError>;
    /// Reads the bytes from `at` on into `into`.
    ///
    /// # Errors
    /// [`FlashError`] if the bytes lie outside the area or cannot be read.
    fn read(&mut self, at: usize, into: &mut [u8]) -> Result<(), FlashError>;
}

/// The parts of a board that [`crate::Node`] uses besides [`crate::RigIo`].
pub trait BoardServices {
    /// The flash that holds the settings: two pages.
    fn settings_flash(&mut self) -> &mut impl Flash;
    /// The flash that holds a new image until the boot loader takes it.
    fn image_flash(&mut self) -> &mut impl Flash;
    /// Whether the saved settings are to be left aside at this start, because a person wants that.
    fn leaves_settings(&self) -> bool {
        false
    }
    /// Which program runs, and how it was chosen.
    fn boot_state(&self) -> BootState;
    /// Whether `signature` over `signed` is of a key that the board trusts (Ed25519, RFC 8032).
    fn trusts(&self, signed: &[u8; ImageHeader::SIGNED], signature: &Signature) -> bool;
    /// The key whose signatures the board trusts.
    fn trusted_key(&self) -> [u8; 32];
    /// Seals the stored image, whose digest and signature have been checked, and tells the boot loader to start it on trial
    /// at the next start.
    ///
    /// # Errors
    /// [`FlashError`]; the old image will start.
    fn schedule_trial(&mut self, image: &ImageHeader, signature: &Signature) -> Result<(), FlashError>;
    /// Tells the boot loader to keep the image on trial.
    ///
    /// # Errors
    /// [`FlashError`]; the image is still on trial.
    fn confirm(&mut self) -> Result<(), FlashError>;
    /// Tells the boot loader to return to the earlier image at the next start; false if there is none.
    ///
    /// # Errors
    /// [`FlashError`]; the same image will start.
    fn roll_back(&mut self) -> Result<bool, FlashError>;
}
