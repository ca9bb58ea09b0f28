//! Formats that boot loader, application and host share (`no_std`, no I/O): the layout of the flash ([`layout`]), the seal
//! by which a boot loader checks an image ([`Seal`]), the image as a file ([`ImageFile`]), version and build id in the image
//! ([`notes`]), and the memory that a board keeps through a reset ([`Survivor`]).

#![no_std]

mod file;
pub mod layout;
pub mod notes;
mod seal;
mod survivor;

pub use file::ImageFile;
pub use seal::{DEVELOPMENT_KEY, SEAL_LENGTH, Seal, SealError, is_signed_by, sha256};
pub use survivor::{Death, DeathKind, SURVIVOR_WORDS, Survivor, TRACE};
