//! A firmware image as a file: its seal, then its bytes. In flash the seal has a fixed place behind the image; in a file it
//! comes first, so that a reader knows at once what follows.

use vergence_protocol::management::ImageHeader;

use crate::seal::{SEAL_LENGTH, Seal, SealError, is_signed_by, sha256};

/// The contents of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageFile<'a> {
    /// Header and signature of the image.
    pub seal: Seal,
    /// The image: the bytes for flash.
    pub image: &'a [u8],
}

impl<'a> ImageFile<'a> {
    /// Reads a file for any hardware. The signature is not checked: see [`Self::is_signed_by`].
    ///
    /// # Errors
    /// [`SealError::Missing`], [`SealError::WrongLength`] or [`SealError::WrongDigest`].
    pub fn read(file: &'a [u8]) -> Result<Self, SealError> {
        let (seal, image) = file.split_first_chunk::<SEAL_LENGTH>().ok_or(SealError::Missing)?;
        let seal = Seal::from_bytes(seal)?;
        if image.is_empty() || usize::try_from(seal.header.length) != Ok(image.len()) {
            return Err(SealError::WrongLength);
        }
        if sha256(image) != seal.header.sha256 {
            return Err(SealError::WrongDigest);
        }
        Ok(Self { seal, image })
    }

    /// Header of the image.
    #[must_use]
    pub const fn header(&self) -> &ImageHeader {
        &self.seal.header
    }

    /// Whether the header is signed by `key`, an Ed25519 public key.
    #[must_use]
    pub fn is_signed_by(&self, key: &[u8; 32]) -> bool {
        is_signed_by(key, &self.seal.header.signed_bytes(), &self.seal.signature)
    }
}
