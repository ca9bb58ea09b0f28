//! The flash and the RAM of the STM32G474RE (512 KiB in two banks, pages of 2 KiB, programmed 8 bytes at a time). The
//! linker's `memory.x` files say the same; a test compares them.

/// What [`vergence_protocol::management::ImageHeader::hardware`] says of images for this board.
pub const HARDWARE: u32 = 0x4734_5645;

/// Start of the flash as the core sees it; all offsets below count from here.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// The smallest piece that can be erased.
pub const PAGE: u32 = 2 * 1024;
/// The smallest piece that can be programmed, once after each erase.
pub const WORD: u32 = 8;

/// The boot loader.
pub const BOOTLOADER: Region = Region { start: 0, length: 62 * 1024 };
/// Progress of a swap: a word for the state, one for its validity, and four for each page of [`ACTIVE`].
pub const STATE: Region = Region { start: 0xF800, length: PAGE };
/// The application that runs, and a page for its seal. A swap moves all of it whatever the image needs, so it is small.
pub const ACTIVE: Region = Region { start: 0x1_0000, length: CAPACITY + PAGE };
/// Two pages of settings, written in turn.
pub const SETTINGS: Region = Region { start: 0x3_F000, length: 2 * PAGE };
/// The image to come, and after the swap the one before: one page more than [`ACTIVE`], as the swap needs. It lies in
/// the second bank, so that the application runs on while this is written.
pub const DFU: Region = Region { start: 0x4_0000, length: ACTIVE.length + PAGE };

/// The longest image. Its seal begins right behind, whatever its length.
pub const CAPACITY: u32 = 96 * 1024;

/// RAM for variables and stack: SRAM1 and SRAM2 less [`SURVIVOR`].
pub const RAM: Region = Region { start: 0x2000_0000, length: 95 * 1024 };
/// RAM that no start-up code touches: [`crate::Survivor`] lies at its beginning.
pub const SURVIVOR: Region = Region { start: 0x2001_7C00, length: 1024 };

/// A piece of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First byte: offset in flash, address in RAM.
    pub start: u32,
    /// How many bytes.
    pub length: u32,
}

impl Region {
    /// The byte after the last.
    #[must_use]
    pub const fn end(self) -> u32 {
        self.start + self.length
    }

    /// Whether it is made of whole pages.
    #[must_use]
    pub const fn is_whole_pages(self) -> bool {
        self.start.is_multiple_of(PAGE) && self.length.is_multiple_of(PAGE)
    }
}
