//! From what a linker makes to the bytes that lie in flash.

use vergence_image::layout::{ACTIVE, CAPACITY, FLASH_BASE, RAM};
use vergence_image::{notes, sha256};
use vergence_mcu::Firmware;

use super::hardware::Hardware;

/// Where an application starts.
const START: u32 = FLASH_BASE + ACTIVE.start;
/// How an ELF file begins.
const MAGIC: &[u8] = b"\x7fELF";

/// Whether a file is an ELF file.
#[must_use]
pub fn is_elf(file: &[u8]) -> bool {
    file.starts_with(MAGIC)
}

/// The bytes of an application in flash, from an ELF file or such bytes.
///
/// # Errors
/// Says what is wrong with it.
pub fn flatten(file: &[u8], hardware: Hardware) -> Result<Vec<u8>, String> {
    let flat = if is_elf(file) { from_elf(file, hardware)? } else { file.to_vec() };
    if flat.is_empty() || flat.len() > CAPACITY as usize {
        return Err(format!("an image has 1 to {CAPACITY} bytes, this one {}", flat.len()));
    }
    if hardware == Hardware::NucleoG474 && !starts_with_vectors(&flat) {
        return Err(format!(
            "this is no application for nucleo-g474: it does not start with a vector table linked for {START:#010x}"
        ));
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

/// Where in flash the contents of an ELF file start.
///
/// # Errors
/// A file that cannot be read.
pub fn elf_start(file: &[u8]) -> Result<u32, String> {
    start_of(&read(file)?)
}

fn read(file: &[u8]) -> Result<Firmware, String> {
    Firmware::from_elf(file).map_err(|error| error.to_string())
}

fn start_of(firmware: &Firmware) -> Result<u32, String> {
    let lowest = firmware.segments().map(|(address, _)| address).min();
    lowest.ok_or_else(|| "this ELF file has nothing to load".into())
}

fn from_elf(file: &[u8], hardware: Hardware) -> Result<Vec<u8>, String> {
    let firmware = read(file)?;
    let start = if hardware == Hardware::NucleoG474 { START } else { start_of(&firmware)? };
    for (address, data) in firmware.segments() {
        let end = u64::from(address) + data.len() as u64;
        if address < start || end > u64::from(start) + u64::from(CAPACITY) {
            return Err(format!(
                "a segment of {} bytes at {address:#010x} lies outside the application's flash, which is {CAPACITY} bytes \
                 from {start:#010x}",
                data.len()
            ));
        }
    }
    Ok(firmware.flat(start))
}

/// A stack in RAM, and a first instruction in the image: else the board would start into nothing.
fn starts_with_vectors(image: &[u8]) -> bool {
    let word = |at: usize| Some(u32::from_le_bytes(image.get(at..at + 4)?.try_into().ok()?));
    let (Some(stack), Some(reset)) = (word(0), word(4)) else { return false };
    let code = (FLASH_BASE + ACTIVE.start)..(FLASH_BASE + ACTIVE.start + image.len() as u32);
    stack > RAM.start && stack <= RAM.end() && reset & 1 == 1 && code.contains(&reset)
}
