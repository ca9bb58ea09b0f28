//! The firmware's log as text: frames in rzCOBS, each an index into the ELF's format strings and its arguments (the
//! defmt book, "Encoding" and "Interned strings").

use defmt_parser::{Fragment, ParserMode, Type, parse};
use vergence_mcu::Firmware;

/// Every whole entry, as "info: text".
///
/// # Panics
/// Where the bytes are not such a log.
pub fn decode(log: &[u8], firmware: &Firmware) -> Vec<String> {
    let Some(last) = log.iter().rposition(|&byte| byte == 0) else { return Vec::new() };
    let frames = log[..last].split(|&byte| byte == 0).filter(|frame| !frame.is_empty());
    frames.map(|frame| entry(frame, firmware)).collect()
}

fn entry(frame: &[u8], firmware: &Firmware) -> String {
    let bytes = rzcobs::decode(frame).expect("rzCOBS");
    let mut arguments = Arguments(&bytes);
    let index = u16::from_le_bytes(arguments.take());
    // The linker places one symbol for each format string; its address is the index and its name is JSON.
    let symbol = firmware.symbol_at(u32::from(index)).expect("a format string with this index");
    let symbol: serde_json::Value = serde_json::from_str(&symbol).expect("JSON");
    let level = symbol["tag"].as_str().and_then(|tag| tag.strip_prefix("defmt_")).expect("a level");
    let format = symbol["data"].as_str().expect("a format string");
    let text: String = parse(format, ParserMode::ForwardsCompatible)
        .expect("a format string")
        .iter()
        .map(|fragment| match fragment {
            Fragment::Literal(text) => text.to_string(),
            Fragment::Parameter(parameter) => arguments.text(&parameter.ty),
        })
        .collect();
    // rzCOBS fills up with zeros.
    assert!(arguments.0.iter().all(|&byte| byte == 0), "{format}: {bytes:?}");
    format!("{level}: {text}")
}

/// What is left of an entry.
struct Arguments<'a>(&'a [u8]);

impl Arguments<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (value, rest) = self.0.split_first_chunk().expect("as many bytes as the format asks for");
        self.0 = rest;
        *value
    }

    /// The next argument; only types that the firmware logs.
    fn text(&mut self, of: &Type) -> String {
        match of {
            Type::U8 => u8::from_le_bytes(self.take()).to_string(),
            Type::U32 => u32::from_le_bytes(self.take()).to_string(),
            Type::U64 => format!("{:016x}", u64::from_le_bytes(self.take())),
            Type::Str => {
                let length = u32::from_le_bytes(self.take()) as usize;
                let (text, rest) = self.0.split_at(length);
                self.0 = rest;
                String::from_utf8_lossy(text).into_owned()
            }
            other => panic!("{other:?} has no place in this log"),
        }
    }
}
