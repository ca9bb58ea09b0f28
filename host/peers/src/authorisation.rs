//! Who may send a rig to a mode: who knows its secret. It is never sent; an order carries a tag that only the secret makes, over a number that
//! the rig gave out for one order.

use std::path::Path;

use hmac::{Hmac, Mac};
use sha2::Sha256;
use vergence_board::hex;

use crate::error::PeersError;

/// A secret has at least this many bytes: 128 bits, where they are random.
const LEAST: usize = 16;
/// What the tag is for, so that it fits nothing else.
const PURPOSE: &str = "vergence mode 1";

/// What a rig and its operators share.
#[derive(Clone)]
pub struct Secret(Vec<u8>);

impl Secret {
    /// The secret in `file`.
    ///
    /// # Errors
    /// [`PeersError::Secret`] where it cannot be read, and where it is too short.
    pub fn read(file: &Path) -> Result<Self, PeersError> {
        let unread = |error: std::io::Error| PeersError::Secret { file: file.to_owned(), why: error.to_string() };
        Self::new(file, &std::fs::read_to_string(file).map_err(unread)?)
    }

    /// The secret in the text of `file`; spaces and lines around it do not count.
    ///
    /// # Errors
    /// [`PeersError::Secret`] where it is too short.
    pub fn new(file: &Path, text: &str) -> Result<Self, PeersError> {
        let text = text.trim().as_bytes();
        if text.len() < LEAST {
            let why = format!("a secret has at least {LEAST} characters; make one with 'openssl rand -hex 32'");
            return Err(PeersError::Secret { file: file.to_owned(), why });
        }
        Ok(Self(text.to_vec()))
    }

    /// The tag of an order, in hexadecimal digits.
    #[must_use]
    pub fn tag(&self, rig: &str, number: &str, mode: &str) -> String {
        mode_tag(&self.0, rig, number, mode)
    }

    /// Whether `tag` is that of the order; compared in a time that does not tell where they differ.
    #[must_use]
    pub fn approves(&self, tag: &str, rig: &str, number: &str, mode: &str) -> bool {
        let right = self.tag(rig, number, mode);
        let differences = right.bytes().zip(tag.bytes()).fold(0, |all, (right, given)| all | (right ^ given));
        right.len() == tag.len() && differences == 0
    }
}

/// HMAC-SHA-256 with `secret` over purpose, rig, number and mode, each on a line of its own.
#[must_use]
pub fn mode_tag(secret: &[u8], rig: &str, number: &str, mode: &str) -> String {
    // A key of any length is taken.
    let Ok(mac) = Hmac::<Sha256>::new_from_slice(secret) else { return String::new() };
    let text = [PURPOSE, rig, number, mode].join("\n");
    hex(&mac.chain_update(text).finalize().into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secret(text: &str) -> Result<Secret, PeersError> {
        Secret::new(Path::new("secret"), text)
    }

    #[test]
    fn only_the_same_order_with_the_same_secret_has_the_tag() {
        let known = secret("0123456789abcdef\n").expect("a secret");
        let other = secret("0123456789abcdeg").expect("a secret");
        let tag = known.tag("bench", "00ff", "human");
        assert!(known.approves(&tag, "bench", "00ff", "human"));
        assert!(!other.approves(&tag, "bench", "00ff", "human"));
        for (rig, number, mode) in [("bencg", "00ff", "human"), ("bench", "00fe", "human"), ("bench", "00ff", "owl")] {
            assert!(!known.approves(&tag, rig, number, mode), "{rig} {number} {mode}");
        }
        assert!(!known.approves("", "bench", "00ff", "human") && !known.approves(&tag[1..], "bench", "00ff", "human"));
    }

    /// Computed by Python: `hmac.new(b"0123456789abcdef", b"vergence mode 1\nbench\n00ff\nhuman", "sha256").hexdigest()`.
    #[test]
    fn the_tag_is_what_other_programs_compute() {
        let tag = mode_tag(b"0123456789abcdef", "bench", "00ff", "human");
        assert_eq!(tag, "9955bfc40518caabef9efb3a6600c71e6f698b8970618f182908eb1554ba04cd");
    }

    #[test]
    fn a_secret_that_can_be_guessed_is_refused() {
        assert!(matches!(secret(" 0123456789abcde \n"), Err(PeersError::Secret { why, .. }) if why.contains("16")));
    }
}
