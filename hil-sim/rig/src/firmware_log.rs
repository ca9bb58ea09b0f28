//! The log of the firmware that runs on a board, by its ELF file.

use vergence_image::layout::HARDWARE;
use vergence_mcu::{Firmware, LogDecoder, LogEntry, LogError};

use crate::application::{ApplicationError, build_of, flatten};

/// The log of a firmware whose ELF file is known: it holds the texts.
pub struct FirmwareLog {
    firmware: Firmware,
    decoder: LogDecoder,
    build: u64,
}

/// An entry of the log, and the functions in which the addresses in its text lie.
#[derive(Clone, Debug)]
pub struct PlacedEntry {
    /// The entry.
    pub entry: LogEntry,
    /// Addresses in the text, each with the name of its function.
    pub places: Vec<String>,
}

impl FirmwareLog {
    /// The log of the firmware of the controller board in an ELF file.
    ///
    /// # Errors
    /// [`ApplicationError`] where the file is not that of an application, or holds no texts.
    pub fn new(elf: &[u8]) -> Result<Self, ApplicationError> {
        let firmware = Firmware::from_elf(elf).map_err(|error| ApplicationError::Elf(error.to_string()))?;
        let decoder = LogDecoder::new(&firmware).map_err(|error| ApplicationError::Elf(error.to_string()))?;
        Ok(Self { firmware, decoder, build: build_of(&flatten(elf, HARDWARE)?) })
    }

    /// Which build the firmware is: with the texts of another one the log would say anything.
    #[must_use]
    pub const fn build(&self) -> u64 {
        self.build
    }

    /// Decodes the next bytes of the log; returns the entries that end in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Result<PlacedEntry, LogError>> {
        let entries = self.decoder.push(bytes).into_iter();
        let placed = |entry: LogEntry| PlacedEntry { places: places(&entry.text, &self.firmware), entry };
        entries.map(|entry| entry.map(placed)).collect()
    }
}

impl PlacedEntry {
    /// The entry as a line for people, and a line for each place.
    #[must_use]
    pub fn line(&self) -> String {
        let Self { entry, places } = self;
        let (time, level) = (entry.time.as_deref().unwrap_or_default(), entry.level.as_deref().unwrap_or_default());
        let places: String = places.iter().map(|place| format!("\n{:21}{place}", "")).collect();
        format!("{time:>12} s {level:5}  {}{places}", entry.text)
    }
}

/// The functions that addresses in `text` lie in. Odd ones are return addresses: the call ends right before them, and may
/// be the last that its function does.
fn places(text: &str, firmware: &Firmware) -> Vec<String> {
    let words = text.split(|character: char| !character.is_ascii_alphanumeric());
    let addresses = words.filter_map(|word| u32::from_str_radix(word.strip_prefix("0x")?, 16).ok());
    let at = |address: u32| if address & 1 == 1 { (address & !1).saturating_sub(2) } else { address };
    addresses.filter_map(|address| Some(format!("{address:#010x} {}", firmware.symbol_at(at(address))?))).collect()
}
