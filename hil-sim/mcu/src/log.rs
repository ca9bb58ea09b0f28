//! The firmware's log as text: defmt frames in rzCOBS, each an index into the ELF file's format strings and its
//! arguments (the defmt book, "Encoding" and "Interned strings"; wire format 4).

mod arguments;

use std::collections::BTreeMap;

use serde_json::Value;

use self::arguments::Arguments;
use crate::firmware::Firmware;

/// The wire format that the decoder reads.
const VERSION: &str = "4";
const ENCODING: &str = "rzcobs";
/// Longer than the longest entry: bytes without an end by then are noise.
const LONGEST: usize = 4_096;

/// A log that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The ELF file describes no log.
    #[error("this ELF file has no defmt log: its symbols were stripped, or it logs in another way")]
    NoLog,
    /// The firmware logs in another format than this program reads.
    #[error("this ELF file logs by defmt {what} {found}, and this program reads {known}: pipe --raw into defmt-print")]
    Unknown {
        /// The property that differs.
        what: &'static str,
        /// Value of the entry in the file.
        found: String,
        /// The value that this program reads.
        known: &'static str,
    },
    /// Bytes were lost, or belong to another program.
    #[error("an entry of {length} bytes cannot be read: bytes were lost on the way")]
    Damaged {
        /// The bytes as they came, encoded.
        length: usize,
    },
}

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// The timestamp of the firmware: seconds since its start.
    pub time: Option<String>,
    /// "trace", "debug", "info", "warn" or "error"; empty where the entry is printed at any level.
    pub level: Option<String>,
    /// The message.
    pub text: String,
}

/// A format string with its tag, such as "defmt_info".
#[derive(Clone, Debug)]
struct FormatString {
    tag: String,
    text: String,
}

/// All format strings by their index.
type Strings = BTreeMap<u16, FormatString>;

/// Turns a stream of bytes into entries.
#[derive(Clone, Debug)]
pub struct LogDecoder {
    strings: Strings,
    /// The format of the time at the beginning of each entry.
    timestamp: Option<String>,
    /// The bytes of an entry that has not ended yet.
    pending: Vec<u8>,
}

impl LogDecoder {
    /// A decoder for the log of `firmware`.
    ///
    /// # Errors
    /// [`LogError`] where the firmware has no log that this program can read.
    pub fn new(firmware: &Firmware) -> Result<Self, LogError> {
        let names = || firmware.symbols().map(|(_, name)| name);
        for (what, mark, known) in
            [("version", "_defmt_version_ = ", VERSION), ("encoding", "_defmt_encoding_ = ", ENCODING)]
        {
            let found = names().find_map(|name| name.strip_prefix(mark)).ok_or(LogError::NoLog)?;
            if found != known {
                return Err(LogError::Unknown { what, found: found.to_owned(), known });
            }
        }
        let strings: Strings = firmware.symbols().filter_map(format_string).collect();
        let timestamp =
            strings.values().find(|string| string.tag == "defmt_timestamp").map(|string| string.text.clone());
        Ok(Self { strings, timestamp, pending: Vec::new() })
    }

    /// Decodes the next bytes of the stream; returns the entries that end in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Result<LogEntry, LogError>> {
        let mut entries = Vec::new();
        for &byte in bytes {
            if byte != 0 && self.pending.len() < LONGEST {
                self.pending.push(byte);
            } else if !self.pending.is_empty() {
                let frame = std::mem::take(&mut self.pending);
                entries.push(self.entry(&frame).ok_or(LogError::Damaged { length: frame.len() }));
            }
        }
        entries
    }

    fn entry(&self, frame: &[u8]) -> Option<LogEntry> {
        let bytes = rzcobs::decode(frame).ok()?;
        let mut arguments = Arguments { bytes: &bytes, strings: &self.strings };
        let FormatString { tag, text } = arguments.string()?;
        let time = match &self.timestamp {
            Some(format) => Some(arguments.text(format, None)?),
            None => None,
        };
        let text = arguments.text(text, None)?;
        // rzCOBS fills up with zeros.
        arguments.bytes.iter().all(|&byte| byte == 0).then_some(())?;
        let level = tag.strip_prefix("defmt_").filter(|level| *level != "println");
        Some(LogEntry { time, level: level.map(str::to_owned), text })
    }
}

/// The linker places one symbol for each format string: its address is the index and its name is JSON.
fn format_string((address, name): (u32, &str)) -> Option<(u16, FormatString)> {
    let symbol: Value = name.starts_with('{').then(|| serde_json::from_str(name).ok())??;
    let [tag, text] = ["tag", "data"].map(|key| symbol.get(key).and_then(Value::as_str).map(str::to_owned));
    Some((u16::try_from(address).ok()?, FormatString { tag: tag?, text: text? }))
}
