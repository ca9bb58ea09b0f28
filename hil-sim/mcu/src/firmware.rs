//! A firmware image from its ELF file: segments to load, and symbols.

use std::ops::Range;
use std::sync::Arc;

use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind, elf};

/// An ELF file that cannot be run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FirmwareError {
    /// The bytes are not a 32-bit ELF file.
    #[error("this cannot be read as a 32-bit ELF file: {0}")]
    NotElf(String),
    /// The file ends before something that it refers to.
    #[error("this ELF file is cut off")]
    CutOff,
    /// The file is for another processor.
    #[error("this ELF file is not for an Arm processor")]
    NotArm,
    /// A segment lies outside flash.
    #[error("a segment of {length} bytes at {address:#010x} is not in flash")]
    OutsideFlash {
        /// The address to load it to.
        address: u32,
        /// Length of the segment in bytes.
        length: usize,
    },
}

/// A function or variable.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Symbol {
    address: u32,
    size: u32,
    name: String,
}

/// A firmware image.
#[derive(Clone, Debug, Default)]
pub struct Firmware {
    segments: Vec<(u32, Vec<u8>)>,
    symbols: Arc<Vec<Symbol>>,
    code: Vec<Range<u32>>,
}

impl Firmware {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// [`FirmwareError`] where it is not an ELF file, or not for this chip.
    pub fn from_elf(bytes: &[u8]) -> Result<Self, FirmwareError> {
        let not_elf = |error: object::Error| FirmwareError::NotElf(error.to_string());
        let file: ElfFile32<Endianness> = ElfFile32::parse(bytes).map_err(not_elf)?;
        if file.architecture() != object::Architecture::Arm {
            return Err(FirmwareError::NotArm);
        }
        let endian = file.endian();
        let mut segments = Vec::new();
        for header in file.elf_program_headers() {
            if header.p_type(endian) == elf::PT_LOAD && header.p_filesz(endian) > 0 {
                let data = header.data(endian, bytes).map_err(|()| FirmwareError::CutOff)?;
                segments.push((header.p_paddr(endian), data.to_vec()));
            }
        }
        Ok(Self { segments, symbols: Arc::new(symbols(&file)), code: code(&file) })
    }

    /// A raw image at an address.
    #[must_use]
    pub fn from_image(address: u32, bytes: &[u8]) -> Self {
        Self { segments: vec![(address, bytes.to_vec())], ..Self::default() }
    }

    /// The segments to load: physical addresses and bytes.
    pub fn segments(&self) -> impl Iterator<Item = (u32, &[u8])> {
        self.segments.iter().map(|(address, bytes)| (*address, bytes.as_slice()))
    }

    /// The contents of flash from `start` on; what is loaded below `start` is left out.
    #[must_use]
    pub fn flat(&self, start: u32) -> Vec<u8> {
        let mut flat = Vec::new();
        for (address, bytes) in self.segments() {
            let Some(from) = address.checked_sub(start).map(|from| from as usize) else { continue };
            let length = flat.len().max(from + bytes.len());
            flat.resize(length, 0xFF);
            flat.splice(from..from + bytes.len(), bytes.iter().copied());
        }
        flat
    }

    /// Address ranges of code without the literals in between: in order, not overlapping.
    #[must_use]
    pub fn code(&self) -> &[Range<u32>] {
        &self.code
    }

    /// The function or variable that contains `address`, with the offset in it, such as "control::tick+0x1c".
    #[must_use]
    pub fn symbol_at(&self, address: u32) -> Option<String> {
        let after = self.symbols.partition_point(|symbol| symbol.address <= address);
        let symbol = self.symbols.get(after.checked_sub(1)?)?;
        let offset = address - symbol.address;
        match offset {
            0 => Some(symbol.name.clone()),
            _ if offset < symbol.size.max(1) => Some(format!("{}+{offset:#x}", symbol.name)),
            _ => None,
        }
    }

    /// All functions and variables: addresses and names.
    pub(crate) fn symbols(&self) -> impl Iterator<Item = (u32, &str)> {
        self.symbols.iter().map(|symbol| (symbol.address, symbol.name.as_str()))
    }

    /// The address of a symbol, by its whole name.
    #[must_use]
    pub fn address_of(&self, name: &str) -> Option<u32> {
        self.symbols.iter().find(|symbol| symbol.name == name).map(|symbol| symbol.address)
    }
}

/// From each mapping symbol "$t" to the next "$t" or "$d" (ELF for the Arm architecture, 5.5.5).
fn code(file: &ElfFile32<Endianness>) -> Vec<Range<u32>> {
    let mut marks: Vec<(u32, bool)> = file
        .symbols()
        .filter_map(|symbol| match symbol.name().ok()?.get(..2)? {
            "$t" => Some((symbol.address() as u32 & !1, true)),
            "$d" => Some((symbol.address() as u32, false)),
            _ => None,
        })
        .collect();
    marks.sort_unstable();
    let pairs = marks.windows(2).filter(|pair| pair[0].1);
    pairs.map(|pair| pair[0].0..pair[1].0).filter(|range| !range.is_empty()).collect()
}

fn symbols(file: &ElfFile32<Endianness>) -> Vec<Symbol> {
    let named = file.symbols().filter(|symbol| matches!(symbol.kind(), SymbolKind::Text | SymbolKind::Data));
    let mut symbols: Vec<_> = named
        .filter_map(|symbol| {
            let name = symbol.name().ok().filter(|name| !name.is_empty() && !name.starts_with('$'))?;
            // Bit 0 of a function's address marks Thumb code.
            let address = symbol.address() as u32 & !u32::from(symbol.kind() == SymbolKind::Text);
            let name = format!("{:#}", rustc_demangle::demangle(name));
            Some(Symbol { address, size: symbol.size() as u32, name })
        })
        .collect();
    symbols.sort_by(|left, right| (left.address, &left.name).cmp(&(right.address, &right.name)));
    symbols
}
