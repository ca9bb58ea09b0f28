//! An image as a file: its seal, then its bytes. In flash the seal lies behind the image, at a place of its own; in a
//! file it comes first, so that whoever reads it knows at once what follows.

use vergence_protocol::management::ImageHeader;

use crate::seal::{SEAL_LENGTH, Seal, SealError, is_signed_by, sha256};

/// An image file, read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageFile<'a> {
    /// What the image says of itself, and its signature.
    pub seal: Seal,
    /// The bytes for flash.
    pub image: &'a [u8],
}

impl<'a> ImageFile<'a> {
    /// Reads a file, whatever hardware it is for. The signature is not judged: see [`Self::is_signed_by`].
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

    /// What the image says of itself.
    #[must_use]
    pub const fn header(&self) -> &ImageHeader {
        &self.seal.header
    }

    /// Whether its header is signed by `key`, an Ed25519 public key.
    #[must_use]
    pub fn is_signed_by(&self, key: &[u8; 32]) -> bool {
        is_signed_by(key, &self.seal.header.signed_bytes(), &self.seal.signature)
    }
}
