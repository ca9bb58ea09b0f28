//! The keys that sign images: Ed25519 (RFC 8032), one key to a file, as a line of text.

use std::fs::OpenOptions;
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use ed25519_dalek::{Signer, SigningKey};
use rand::TryRng;
use vergence_files::{FileError, read_text, write_whole};
use vergence_image::{DEVELOPMENT_KEY, Seal};
use vergence_protocol::management::{ImageHeader, Signature};

use super::KeyError;

/// The name of the key whose secret everybody knows.
pub const DEVELOPMENT: &str = "development";
/// RFC 8032, section 7.1, test 1: the secret of [`DEVELOPMENT_KEY`].
const DEVELOPMENT_SECRET: &str = "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60";
const SECRET: &str = "vergence-secret-key";
const PUBLIC: &str = "vergence-public-key";

/// A key that signs.
pub struct SecretKey(SigningKey);

/// A key that judges signatures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey(pub [u8; 32]);

/// A new key from the operating system's random numbers.
///
/// # Errors
/// Where it gives none.
pub fn fresh_secret() -> Result<SecretKey, KeyError> {
    let mut seed = [0; 32];
    rand::rngs::SysRng.try_fill_bytes(&mut seed).map_err(|error| KeyError::Random(error.to_string()))?;
    Ok(SecretKey(SigningKey::from_bytes(&seed)))
}

impl SecretKey {
    /// The key in the file of that name, or the development key by its name.
    ///
    /// # Errors
    /// A file that holds none.
    pub fn named(name: &Path) -> Result<Self, KeyError> {
        if name.as_os_str() == DEVELOPMENT {
            return key_bytes(DEVELOPMENT_SECRET)
                .map(|seed| Self(SigningKey::from_bytes(&seed)))
                .ok_or(KeyError::Development);
        }
        let seed = read(name, SECRET, "a secret key: make one with 'vergence image keygen'")?;
        Ok(Self(SigningKey::from_bytes(&seed)))
    }

    /// Its public half.
    #[must_use]
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key().to_bytes())
    }

    /// Signs a header.
    #[must_use]
    pub fn seal(&self, header: ImageHeader) -> Seal {
        let signature = self.0.sign(&header.signed_bytes());
        Seal { header, signature: Signature { r: *signature.r_bytes(), s: *signature.s_bytes() } }
    }

    /// Writes a file that only its owner may read, and never over another one.
    ///
    /// # Errors
    /// Where there is a file already, or none can be written.
    pub fn write_new(&self, path: &Path) -> Result<(), KeyError> {
        let line = format!("{SECRET} {}\n", hex(self.0.as_bytes()));
        let mut options = OpenOptions::new();
        options.write(true).create_new(true).mode(0o600);
        let written = options.open(path).and_then(|mut file| file.write_all(line.as_bytes()));
        written.map_err(|error| FileError::write(path, error).into())
    }
}

impl PublicKey {
    /// The key in the file of that name, or the development key by its name.
    ///
    /// # Errors
    /// A file that holds none.
    pub fn named(name: &Path) -> Result<Self, KeyError> {
        if name.as_os_str() == DEVELOPMENT {
            return Ok(Self(DEVELOPMENT_KEY));
        }
        read(name, PUBLIC, "a public key, which 'vergence image keygen' writes to a .pub file").map(Self)
    }

    /// Whether it is the key whose secret everybody knows.
    #[must_use]
    pub fn is_development(&self) -> bool {
        self.0 == DEVELOPMENT_KEY
    }

    /// The key in words: its first bytes, or the name of the development key.
    #[must_use]
    pub fn describe(&self) -> String {
        if self.is_development() { "the development key".into() } else { format!("key {}...", hex(&self.0[..8])) }
    }

    /// Writes a file.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), KeyError> {
        Ok(write_whole(path, format!("{PUBLIC} {}\n", hex(&self.0)).as_bytes())?)
    }
}

fn read(path: &Path, kind: &str, wanted: &'static str) -> Result<[u8; 32], KeyError> {
    read_text(path)?
        .trim()
        .strip_prefix(kind)
        .and_then(|digits| key_bytes(digits.trim()))
        .ok_or_else(|| KeyError::NotAKey { path: path.to_owned(), wanted })
}

fn key_bytes(digits: &str) -> Option<[u8; 32]> {
    let mut bytes = [0; 32];
    if digits.len() != 64 || !digits.is_ascii() {
        return None;
    }
    for (byte, at) in bytes.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(digits.get(at..at + 2)?, 16).ok()?;
    }
    Some(bytes)
}

/// Bytes as hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
