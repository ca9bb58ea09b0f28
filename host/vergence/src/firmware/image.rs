//! Image files, and what they say of themselves.

use std::path::Path;

use serde_json::{Value, json};
use vergence_image::{ImageFile, Seal};
use vergence_protocol::management::ImageHeader;

use super::hardware::hardware_name;
use super::keys::hex;
use crate::failure::Failure;

/// An image file, read and found whole.
pub struct OwnedImage {
    /// Header and signature.
    pub seal: Seal,
    /// The bytes for flash.
    pub bytes: Vec<u8>,
}

impl OwnedImage {
    /// Reads an image file.
    ///
    /// # Errors
    /// A file that is none, or a damaged one.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let file = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
        let ImageFile { seal, image } = ImageFile::read(&file)
            .map_err(|error| Failure::input(path, format!("{error}; images are made with 'vergence image sign'")))?;
        Ok(Self { seal, bytes: image.to_vec() })
    }

    /// What it says of itself.
    #[must_use]
    pub const fn header(&self) -> &ImageHeader {
        &self.seal.header
    }
}

/// A header for programs.
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

/// `1.2.3`.
#[must_use]
pub fn version_text([major, minor, patch]: [u8; 3]) -> String {
    format!("{major}.{minor}.{patch}")
}

/// A version of three numbers.
///
/// # Errors
/// Says what is expected.
pub fn parse_version(text: &str) -> Result<[u8; 3], String> {
    let numbers: Option<Vec<u8>> = text.split('.').map(|part| part.parse().ok()).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "a version is three numbers up to 255, such as 1.2.3".into())
}
