//! From what a linker makes to the bytes that lie in flash.

use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Architecture, Endianness, Object, elf};
use vergence_image::layout::{ACTIVE, CAPACITY, FLASH_BASE, RAM};
use vergence_image::notes::build_at;
use vergence_image::sha256;

use super::hardware::Hardware;

/// Where an application starts.
const START: u64 = (FLASH_BASE + ACTIVE.start) as u64;
/// What flash holds where nothing was written.
const ERASED: u8 = 0xFF;
/// Whether a file is an ELF file.
#[must_use]
pub fn is_elf(file: &[u8]) -> bool {
    file.starts_with(&elf::ELFMAG)
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
    let id = build_at(image).and_then(|at| image.get(at..)?.first_chunk().copied());
    let digest = sha256(image);
    u64::from_be_bytes(id.or_else(|| digest.first_chunk().copied()).unwrap_or_default())
}

/// Where in flash the contents of an ELF file start.
///
/// # Errors
/// A file that cannot be read.
pub fn elf_start(file: &[u8]) -> Result<u64, String> {
    let lowest = segments(file)?.iter().map(|(address, _)| *address).min();
    lowest.ok_or_else(|| "this ELF file has nothing to load".into())
}

fn from_elf(file: &[u8], hardware: Hardware) -> Result<Vec<u8>, String> {
    let start = if hardware == Hardware::NucleoG474 { START } else { elf_start(file)? };
    join(&segments(file)?, start)
}

/// What to load: physical addresses and bytes.
fn segments(file: &[u8]) -> Result<Vec<(u64, &[u8])>, String> {
    let parsed: ElfFile32<Endianness> =
        ElfFile32::parse(file).map_err(|error| format!("this ELF file cannot be read: {error}"))?;
    if parsed.architecture() != Architecture::Arm {
        return Err("this ELF file is not for an Arm processor".into());
    }
    let mut segments = Vec::new();
    for header in parsed.elf_program_headers() {
        let endian = parsed.endian();
        if header.p_type(endian) == elf::PT_LOAD && header.p_filesz(endian) > 0 {
            let data = header.data(endian, file).map_err(|()| "this ELF file is cut off".to_owned())?;
            segments.push((u64::from(header.p_paddr(endian)), data));
        }
    }
    Ok(segments)
}

/// The segments in their places, and erased flash between them.
fn join(segments: &[(u64, &[u8])], start: u64) -> Result<Vec<u8>, String> {
    let mut flat = Vec::new();
    for (address, data) in segments {
        let outside = || {
            format!(
                "a segment of {} bytes at {address:#010x} lies outside the application's flash, which is {CAPACITY} bytes \
                 from {start:#010x}",
                data.len()
            )
        };
        let end = address.saturating_add(data.len() as u64);
        if *address < start || end > start + u64::from(CAPACITY) {
            return Err(outside());
        }
        let (from, to) = ((address - start) as usize, (end - start) as usize);
        if flat.len() < to {
            flat.resize(to, ERASED);
        }
        flat.get_mut(from..to).ok_or_else(outside)?.copy_from_slice(data);
    }
    Ok(flat)
}

/// A stack in RAM, and a first instruction in the image: else the board would start into nothing.
fn starts_with_vectors(image: &[u8]) -> bool {
    let word = |at: usize| Some(u32::from_le_bytes(image.get(at..at + 4)?.try_into().ok()?));
    let (Some(stack), Some(reset)) = (word(0), word(4)) else { return false };
    let code = (FLASH_BASE + ACTIVE.start)..(FLASH_BASE + ACTIVE.start + image.len() as u32);
    stack > RAM.start && stack <= RAM.end() && reset & 1 == 1 && code.contains(&reset)
}
