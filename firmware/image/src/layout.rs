//! Layout of flash and RAM of the STM32G474RE (512 KiB in two banks, pages of 2 KiB, programmed 8 bytes at a time). The
//! linker's `memory.x` files hold the same figures; a test compares them.

/// Hardware id of this board and layout, which images name in [`vergence_protocol::management::ImageHeader::hardware`]. It
/// changes with the layout, because an image that expects another one would write into the boot loader.
pub const HARDWARE: u32 = 0x4734_5646;

/// Address of the flash; all flash offsets below count from here.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Bytes of a page, the smallest part of the flash that can be erased.
pub const PAGE: u32 = 2 * 1024;
/// Bytes of a word, the smallest part of the flash that can be programmed, once after each erase.
pub const WORD: u32 = 8;

/// Flash of the boot loader.
pub const BOOTLOADER: Region = Region { start: 0, length: 58 * 1024 };
/// Flash pages for the progress of a swap: a word for the state, one for its validity, four for each page of [`ACTIVE`], and
/// in the last word the number of pages that the swap moves.
pub const STATE: Region = Region { start: 0xE800, length: 2 * PAGE };
/// Flash of the running application: a page for its seal, then the image. A swap moves the seal and as many pages as the
/// longer of the two images has.
pub const ACTIVE: Region = Region { start: 0xF800, length: PAGE + CAPACITY };
/// Flash of the settings: two pages, written in turn.
pub const SETTINGS: Region = Region { start: 0x3_F000, length: 2 * PAGE };
/// Flash of the next image with its seal, and after a swap of the earlier one: one page more than [`ACTIVE`], as the swap
/// needs. It lies in the second bank, so that the application runs on while this is written.
pub const DFU: Region = Region { start: 0x4_0000, length: ACTIVE.length + PAGE };

/// Flash of the image of the running application, behind its seal. Its vector table is at the start.
pub const IMAGE: Region = Region { start: ACTIVE.start + PAGE, length: CAPACITY };
/// Length of the longest image in bytes.
pub const CAPACITY: u32 = 184 * 1024;

/// Number of pages that a swap moves for images of these lengths in bytes: those of the longer one, and that of the seal.
#[must_use]
pub const fn pages_to_swap(one: u32, other: u32) -> u32 {
    let longer = if one > other { one } else { other };
    let longer = if longer < CAPACITY { longer } else { CAPACITY };
    1 + longer.div_ceil(PAGE)
}

/// RAM for variables and stack: SRAM1 and SRAM2 less [`SURVIVOR`].
pub const RAM: Region = Region { start: 0x2000_0000, length: 95 * 1024 };
/// The part of [`RAM`] for the stack. It ends where the SRAM begins, so that a stack that is too small is a bus fault and does
/// not overwrite variables.
pub const STACK: Region = Region { start: RAM.start, length: 64 * 1024 };
/// RAM that no start-up code touches; [`crate::Survivor`] lies at its start.
pub const SURVIVOR: Region = Region { start: 0x2001_7C00, length: 1024 };

/// A range of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First byte: offset in flash, address in RAM.
    pub start: u32,
    /// Length in bytes.
    pub length: u32,
}

impl Region {
    /// Offset or address of the byte after the last.
    #[must_use]
    pub const fn end(self) -> u32 {
        self.start + self.length
    }

    /// Whether the region consists of whole pages.
    #[must_use]
    pub const fn is_whole_pages(self) -> bool {
        self.start.is_multiple_of(PAGE) && self.length.is_multiple_of(PAGE)
    }
}
