//! The seal of an image: its header and signature behind it in flash, so that a swap carries them along and a boot
//! loader can judge what it finds.
//!
//! ```text
//! 0 magic | 4 signed header | 55 signature | 119 CRC-32C of all before | 123 filled up with 0xFF
//! ```

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, NoTable};
use sha2::{Digest, Sha256};
use vergence_protocol::management::{ImageHeader, Signature};

use crate::layout::{CAPACITY, HARDWARE};

/// How many bytes a seal takes: whole words of the flash.
pub const SEAL_LENGTH: usize = 128;
const MAGIC: [u8; 4] = *b"VGIM";
const SIGNATURE: usize = 4 + ImageHeader::SIGNED;
const CHECK: usize = SIGNATURE + 64;
const CASTAGNOLI: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// The public key of development images: that of test 1 in RFC 8032, section 7.1, whose secret everybody can read
/// there. Whoever wants signatures to keep strangers out builds boot loader and application with a key of their own.
pub const DEVELOPMENT_KEY: [u8; 32] = [
    0xd7, 0x5a, 0x98, 0x01, 0x82, 0xb1, 0x0a, 0xb7, 0xd5, 0x4b, 0xfe, 0xd3, 0xc9, 0x64, 0x07, 0x3a, 0x0e, 0xe1, 0x72,
    0xf3, 0xda, 0xa6, 0x23, 0x25, 0xaf, 0x02, 0x1a, 0x68, 0xf7, 0x07, 0x51, 0x1a,
];

/// Header and signature of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// What the image says of itself.
    pub header: ImageHeader,
    /// Over [`ImageHeader::signed_bytes`].
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
    /// The header names a length that cannot be.
    WrongLength,
    /// The bytes do not have the digest that the header names.
    WrongDigest,
    /// The signature is not of the key.
    WrongSignature,
}

impl Seal {
    /// The bytes for flash.
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

    /// Reads a seal.
    ///
    /// # Errors
    /// [`SealError::Missing`].
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

    /// Judges the image at the start of `region`, whose seal is at byte [`CAPACITY`]: hardware, length, digest, signature.
    ///
    /// # Errors
    /// Says what is wrong.
    pub fn check(region: &[u8], key: &[u8; 32]) -> Result<Self, SealError> {
        let (image, rest) = region.split_at_checked(CAPACITY as usize).ok_or(SealError::Missing)?;
        let seal = Self::from_bytes(rest.first_chunk().ok_or(SealError::Missing)?)?;
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
            Self::WrongDigest => "the image is damaged: its digest is not that of its header",
            Self::WrongSignature => "the signature is not of the key",
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

/// SHA-256 (FIPS 180-4).
#[must_use]
pub fn sha256(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// What is left to read of fields without gaps.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    /// The next field; zeros where the bytes end.
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((field, rest)) = self.0.split_first_chunk::<N>() else { return [0; N] };
        self.0 = rest;
        *field
    }
}
