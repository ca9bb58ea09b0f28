//! Keys that sign firmware images, image headers as text, and flash written through a debug probe.

mod error;
mod keys;
mod probe_rs;
mod words;

pub use self::error::{KeyError, ProbeError};
pub use self::keys::{DEVELOPMENT, PublicKey, SecretKey, fresh_secret, hex};
pub use self::probe_rs::{FlashContents, ProbeRs};
pub use self::words::{header_json, parse_version};
