//! The seam between the core and flash memory: one area, erased by pages, programmed by units.

/// The smallest part that can be erased, in bytes (STM32G4 with two banks, ST RM0440 section 3.3.1).
pub const PAGE: usize = 2048;
/// What is programmed at once, in bytes (the same source).
pub const UNIT: usize = 8;

/// The flash did not do what it was told, or power went.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the flash failed")]
pub struct FlashError;

/// An area of flash. Calls block: a page takes some 20 ms to erase, so nothing may move meanwhile.
pub trait Flash {
    /// How many pages it has.
    fn pages(&self) -> usize;
    /// Sets all bytes of a page to 0xFF.
    ///
    /// # Errors
    /// [`FlashError`]; the page may hold anything now.
    fn erase(&mut self, page: usize) -> Result<(), FlashError>;
    /// Programs one unit at byte `at`, a multiple of [`UNIT`], that has not been programmed since it was erased.
    ///
    /// # Errors
    /// [`FlashError`]; the unit may hold anything now.
    fn program(&mut self, at: usize, unit: [u8; UNIT]) -> Result<(), FlashError>;
    /// Reads from byte `at` on.
    ///
    /// # Errors
    /// [`FlashError`] where that is outside the area or cannot be read.
    fn read(&mut self, at: usize, into: &mut [u8]) -> Result<(), FlashError>;
}
