//! Image headers as JSON, and versions as people write them.

use serde_json::{Value, json};
use vergence_protocol::management::ImageHeader;

use super::keys::hex;
use crate::update::{hardware_name, version_text};

/// An image header as JSON.
#[must_use]
pub fn header_json(header: &ImageHeader) -> Value {
    json!({
        "hardware": hardware_name(header.hardware),
        "version": version_text(header.version),
        "length": header.length,
        "build": format!("{:016x}", header.build),
        "sha256": hex(&header.sha256),
    })
}

/// Parses a version of three numbers.
///
/// # Errors
/// A sentence that says what is expected.
pub fn parse_version(text: &str) -> Result<[u8; 3], String> {
    let numbers: Option<Vec<u8>> = text.split('.').map(|part| part.parse().ok()).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "a version is three numbers up to 255, such as 1.2.3".into())
}
