//! From what a linker makes to the bytes that lie in flash.

use vergence_image::layout::{BOOTLOADER, CAPACITY, FLASH_BASE, HARDWARE, IMAGE, RAM};
use vergence_image::{notes, sha256};
use vergence_mcu::Firmware;

/// Where an application starts.
const START: u32 = FLASH_BASE + IMAGE.start;
/// How an ELF file begins.
const MAGIC: &[u8] = b"\x7fELF";

/// Why a file is no application.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ApplicationError {
    /// The ELF file cannot be read.
    #[error("{0}")]
    Elf(String),
    /// The ELF file has no contents for memory.
    #[error("this ELF file has nothing to load")]
    Nothing,
    /// It has no bytes, or more than fit into flash.
    #[error("an image has 1 to {CAPACITY} bytes, this one {0}")]
    Length(usize),
    /// It does not begin as an application of the controller board does.
    #[error("this is no application for nucleo-g474: it does not start with a vector table linked for {START:#010x}")]
    NoVectors,
    /// A part of it lies elsewhere.
    #[error(
        "a segment of {length} bytes at {address:#010x} lies outside the application's flash, which is {CAPACITY} bytes from \
         {start:#010x}"
    )]
    Outside {
        /// Bytes of the segment.
        length: usize,
        /// Its address.
        address: u32,
        /// Where the application's flash starts.
        start: u32,
    },
    /// It is an ELF file of something that is not the boot loader.
    #[error(
        "this ELF file starts at {0:#010x} and is not the boot loader, which starts signed images only: sign it with \
         'vergence image sign' and flash the image"
    )]
    NotBootLoader(u32),
}

/// Whether a file is an ELF file.
#[must_use]
pub fn is_elf(file: &[u8]) -> bool {
    file.starts_with(MAGIC)
}

/// The bytes of an application in flash, from an ELF file or such bytes; `hardware` is the number in image headers of the board
/// that it is for.
///
/// # Errors
/// [`ApplicationError`].
pub fn flatten(file: &[u8], hardware: u32) -> Result<Vec<u8>, ApplicationError> {
    let flat = if is_elf(file) { from_elf(file, hardware)? } else { file.to_vec() };
    if flat.is_empty() || flat.len() > CAPACITY as usize {
        return Err(ApplicationError::Length(flat.len()));
    }
    if hardware == HARDWARE && !starts_with_vectors(&flat) {
        return Err(ApplicationError::NoVectors);
    }
    Ok(flat)
}

/// Which build: the first eight bytes of the linker's build id, as the application itself reads it, or else of the digest.
#[must_use]
pub fn build_of(image: &[u8]) -> u64 {
    notes::build_of(image).unwrap_or_else(|| {
        let digest = sha256(image);
        u64::from_be_bytes(digest.first_chunk().copied().unwrap_or_default())
    })
}

/// Refuses an ELF file that is not the boot loader's: without a seal, the boot loader would not start it.
///
/// # Errors
/// [`ApplicationError`].
pub fn check_boot_loader(file: &[u8]) -> Result<(), ApplicationError> {
    match start_of(&read(file)?)? {
        start if start == FLASH_BASE + BOOTLOADER.start => Ok(()),
        start => Err(ApplicationError::NotBootLoader(start)),
    }
}

fn read(file: &[u8]) -> Result<Firmware, ApplicationError> {
    Firmware::from_elf(file).map_err(|error| ApplicationError::Elf(error.to_string()))
}

fn start_of(firmware: &Firmware) -> Result<u32, ApplicationError> {
    firmware.segments().map(|(address, _)| address).min().ok_or(ApplicationError::Nothing)
}

fn from_elf(file: &[u8], hardware: u32) -> Result<Vec<u8>, ApplicationError> {
    let firmware = read(file)?;
    let start = if hardware == HARDWARE { START } else { start_of(&firmware)? };
    for (address, data) in firmware.segments() {
        let end = u64::from(address) + data.len() as u64;
        if address < start || end > u64::from(start) + u64::from(CAPACITY) {
            return Err(ApplicationError::Outside { length: data.len(), address, start });
        }
    }
    Ok(firmware.flat(start))
}

/// A stack in RAM, and a first instruction in the image: else the board would start into nothing.
fn starts_with_vectors(image: &[u8]) -> bool {
    let word = |at: usize| Some(u32::from_le_bytes(image.get(at..at + 4)?.try_into().ok()?));
    let (Some(stack), Some(reset)) = (word(0), word(4)) else { return false };
    let code = (FLASH_BASE + IMAGE.start)..(FLASH_BASE + IMAGE.start + image.len() as u32);
    stack > RAM.start && stack <= RAM.end() && reset & 1 == 1 && code.contains(&reset)
}
