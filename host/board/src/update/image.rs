//! Signed firmware images as files, and the names of the hardware that they are for.

use std::path::Path;

use serde_json::{Value, json};
use vergence_image::layout::HARDWARE;
use vergence_image::{ImageFile, Seal};
use vergence_protocol::management::{Identity, ImageHeader, NATIVE_HARDWARE};

/// A signed firmware image: header, signature and code.
#[derive(Clone, Debug, PartialEq)]
pub struct FirmwareImage {
    /// Header and signature.
    pub seal: Seal,
    /// The bytes for flash.
    pub bytes: Vec<u8>,
}

/// Why a file is no firmware image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFileError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(String),
    /// The file is not an image, or a damaged one.
    #[error("{0}; images are made with 'vergence image sign'")]
    Format(String),
}

impl FirmwareImage {
    /// Reads an image file and checks that it is whole.
    ///
    /// # Errors
    /// [`ImageFileError`] where the file cannot be read, is no image, or is damaged.
    pub fn read(path: &Path) -> Result<Self, ImageFileError> {
        let file = std::fs::read(path).map_err(|error| ImageFileError::Read(error.to_string()))?;
        let ImageFile { seal, image } =
            ImageFile::read(&file).map_err(|error| ImageFileError::Format(error.to_string()))?;
        Ok(Self { seal, bytes: image.to_vec() })
    }

    /// The header: hardware, version, length, build and digest.
    #[must_use]
    pub const fn header(&self) -> &ImageHeader {
        &self.seal.header
    }
}

/// The name of a kind of board by the number in image headers; unknown numbers are written in hexadecimal.
#[must_use]
pub fn hardware_name(id: u32) -> String {
    match id {
        HARDWARE => "nucleo-g474".into(),
        NATIVE_HARDWARE => "native-sim".into(),
        unknown => format!("unknown hardware {unknown:#010x}"),
    }
}

/// A firmware version as text, such as `1.2.3`.
#[must_use]
pub fn version_text([major, minor, patch]: [u8; 3]) -> String {
    format!("{major}.{minor}.{patch}")
}

/// What a board runs, as a sentence.
#[must_use]
pub fn identity_words(identity: &Identity) -> String {
    let (hardware, version) = (hardware_name(identity.hardware), version_text(identity.version));
    format!("{hardware} runs {version} (build {:016x}), {}", identity.build, identity.boot)
}

/// What a board runs, for programs.
#[must_use]
pub fn identity_json(identity: &Identity) -> Value {
    json!({
        "hardware": hardware_name(identity.hardware),
        "version": version_text(identity.version),
        "oldest": version_text(identity.oldest),
        "build": format!("{:016x}", identity.build),
        "boot": format!("{:?}", identity.boot).to_lowercase(),
        "capacity": identity.capacity,
    })
}
