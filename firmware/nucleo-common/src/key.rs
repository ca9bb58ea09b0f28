//! The key whose signatures boot loader and application trust. It is chosen when they are built: the file that
//! `VERGENCE_PUBLIC_KEY` names, or else the development key. Build both with the same one.

/// The key that is trusted (Ed25519).
#[must_use]
pub fn trusted_key() -> &'static [u8; 32] {
    // One copy in flash, which a person can find and compare.
    core::hint::black_box(&TRUSTED_KEY)
}

include!(concat!(env!("OUT_DIR"), "/key.rs"));
