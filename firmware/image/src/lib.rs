//! What boot loader, application and host must agree on (`no_std`, no I/O): where everything lies in flash
//! ([`layout`]), how an image is sealed so that a boot loader can judge it ([`Seal`]), how it travels as a file
//! ([`ImageFile`]), what it says of itself ([`notes`]), and what a board remembers through a reset ([`Survivor`]).

#![no_std]

mod file;
pub mod layout;
pub mod notes;
mod seal;
mod survivor;

pub use file::ImageFile;
pub use seal::{DEVELOPMENT_KEY, SEAL_LENGTH, Seal, SealError, is_signed_by, sha256};
pub use survivor::{Death, DeathKind, SURVIVOR_WORDS, Survivor, TRACE};
