//! The seal of an image: header and signature, in the page before the image in flash, so that a swap moves them along and
//! the boot loader can check the image.
//!
//! ```text
//! 0 magic | 4 signed header | 55 signature | 119 CRC-32C of all before | 123 filled up with 0xFF
//! ```

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, NoTable};
use sha2::{Digest, Sha256};
use vergence_protocol::management::{ImageHeader, Signature};

use crate::layout::{CAPACITY, HARDWARE, PAGE};

/// Length of a seal in bytes: whole words of the flash.
pub const SEAL_LENGTH: usize = 128;
const MAGIC: [u8; 4] = *b"VGIM";
const SIGNATURE: usize = 4 + ImageHeader::SIGNED;
const CHECK: usize = SIGNATURE + 64;
const CASTAGNOLI: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// Public key of development images: that of test 1 in RFC 8032, section 7.1, whose secret key is published there. For
/// signatures that keep strangers out, build boot loader and application with a key of your own.
pub const DEVELOPMENT_KEY: [u8; 32] = [
    0xd7, 0x5a, 0x98, 0x01, 0x82, 0xb1, 0x0a, 0xb7, 0xd5, 0x4b, 0xfe, 0xd3, 0xc9, 0x64, 0x07, 0x3a, 0x0e, 0xe1, 0x72,
    0xf3, 0xda, 0xa6, 0x23, 0x25, 0xaf, 0x02, 0x1a, 0x68, 0xf7, 0x07, 0x51, 0x1a,
];

/// Header and signature of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// Description of the image.
    pub header: ImageHeader,
    /// Signature over [`ImageHeader::signed_bytes`].
    pub signature: Signature,
}

/// Why an image must not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SealError {
    /// There is no seal, or it is damaged.
    Missing,
    /// The image is for other hardware.
    WrongHardware,
    /// The image is not as long as its header says, or its length is impossible.
    WrongLength,
    /// The image's SHA-256 differs from the header's.
    WrongDigest,
    /// The signature is not of the expected key.
    WrongSignature,
}

impl Seal {
    /// The seal as it is stored.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; SEAL_LENGTH] {
        let mut bytes = [0xFF; SEAL_LENGTH];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..SIGNATURE].copy_from_slice(&self.header.signed_bytes());
        bytes[SIGNATURE..SIGNATURE + 32].copy_from_slice(&self.signature.r);
        bytes[SIGNATURE + 32..CHECK].copy_from_slice(&self.signature.s);
        let check = CASTAGNOLI.checksum(&bytes[..CHECK]);
        bytes[CHECK..CHECK + 4].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    /// Reads a stored seal.
    ///
    /// # Errors
    /// [`SealError::Missing`] if the bytes are no seal or are damaged.
    pub fn from_bytes(bytes: &[u8; SEAL_LENGTH]) -> Result<Self, SealError> {
        let check = CASTAGNOLI.checksum(&bytes[..CHECK]).to_le_bytes();
        if bytes[..4] != MAGIC || bytes[CHECK..CHECK + 4] != check {
            return Err(SealError::Missing);
        }
        let mut fields = Fields(&bytes[4..CHECK]);
        let header = ImageHeader {
            hardware: u32::from_le_bytes(fields.take()),
            version: fields.take(),
            length: u32::from_le_bytes(fields.take()),
            build: u64::from_le_bytes(fields.take()),
            sha256: fields.take(),
        };
        Ok(Self { header, signature: Signature { r: fields.take(), s: fields.take() } })
    }

    /// Checks hardware, length, digest and signature of the image in `region`, which begins with the seal in a page of its
    /// own.
    ///
    /// # Errors
    /// [`SealError`] names the first of these that is wrong.
    pub fn check(region: &[u8], key: &[u8; 32]) -> Result<Self, SealError> {
        let (seal, image) = region.split_at_checked(PAGE as usize).ok_or(SealError::Missing)?;
        let seal = Self::from_bytes(seal.first_chunk().ok_or(SealError::Missing)?)?;
        seal.header_is_for_us()?;
        let length = usize::try_from(seal.header.length).map_err(|_| SealError::WrongLength)?;
        let image = image.get(..length).ok_or(SealError::WrongLength)?;
        if sha256(image) != seal.header.sha256 {
            return Err(SealError::WrongDigest);
        }
        if !is_signed_by(key, &seal.header.signed_bytes(), &seal.signature) {
            return Err(SealError::WrongSignature);
        }
        Ok(seal)
    }

    fn header_is_for_us(&self) -> Result<(), SealError> {
        if self.header.hardware != HARDWARE {
            return Err(SealError::WrongHardware);
        }
        if self.header.length == 0 || self.header.length > CAPACITY {
            return Err(SealError::WrongLength);
        }
        Ok(())
    }
}

impl fmt::Display for SealError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "this is no signed image, or its header is damaged",
            Self::WrongHardware => "the image is for other hardware",
            Self::WrongLength => "the image is not as long as its header says",
            Self::WrongDigest => "the image is damaged: its SHA-256 is not that of its header",
            Self::WrongSignature => "the image is not signed with the expected key",
        })
    }
}

/// Whether `signature` over `message` is of `key` (Ed25519, RFC 8032).
#[must_use]
pub fn is_signed_by(key: &[u8; 32], message: &[u8], signature: &Signature) -> bool {
    let mut bytes = [0; 64];
    bytes[..32].copy_from_slice(&signature.r);
    bytes[32..].copy_from_slice(&signature.s);
    salty::PublicKey::try_from(key).and_then(|key| key.verify(message, &(&bytes).into())).is_ok()
}

/// SHA-256 of `bytes` (FIPS 180-4).
#[must_use]
pub fn sha256(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// Reader of consecutive fields.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    /// Reads the next field; zeros if the bytes end before it.
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((field, rest)) = self.0.split_first_chunk::<N>() else { return [0; N] };
        self.0 = rest;
        *field
    }
}
