//! The seam between the node and what a board has besides its axes: flash, boot loader and trusted key.

use vergence_protocol::management::{BootState, ImageHeader, Signature};

use crate::flash::{Flash, FlashError};

/// What [`crate::Node`] needs of a board besides [`crate::RigIo`].
pub trait BoardServices {
    /// Where the settings are kept: two pages.
    fn settings_flash(&mut self) -> &mut impl Flash;
    /// Where a new image is stored until the boot loader takes it.
    fn image_flash(&mut self) -> &mut impl Flash;
    /// What runs, and how it came to.
    fn boot_state(&self) -> BootState;
    /// Whether `signature` over `signed` is of a key that the board trusts (Ed25519, RFC 8032).
    fn trusts(&self, signed: &[u8; ImageHeader::SIGNED], signature: &Signature) -> bool;
    /// Seals the stored image, checked against header and signature, and tells the boot loader to start it on trial at
    /// the next start.
    ///
    /// # Errors
    /// [`FlashError`]; the old image will start.
    fn schedule_trial(&mut self, image: &ImageHeader, signature: &Signature) -> Result<(), FlashError>;
    /// Tells the boot loader to keep the image on trial.
    ///
    /// # Errors
    /// [`FlashError`]; the image is still on trial.
    fn confirm(&mut self) -> Result<(), FlashError>;
    /// Tells the boot loader to go back to the image before at the next start; false where there is none.
    ///
    /// # Errors
    /// [`FlashError`]; the same image will start.
    fn roll_back(&mut self) -> Result<bool, FlashError>;
}
