//! The firmware's log as text.

use vergence_mcu::{Firmware, LogDecoder};

/// Every whole entry, as "info: text".
///
/// # Panics
/// Where the bytes are not such a log.
pub fn decode(log: &[u8], firmware: &Firmware) -> Vec<String> {
    let entries = LogDecoder::new(firmware).expect("it logs by defmt").push(log);
    let text = |entry: Result<vergence_mcu::LogEntry, _>| {
        let entry = entry.expect("an entry of this firmware");
        format!("{}: {}", entry.level.expect("a level"), entry.text)
    };
    entries.into_iter().map(text).collect()
}
