//! Why a key cannot be used, and why a debug probe does not write flash.

use std::path::PathBuf;

use vergence_files::FileError;

/// Why there is no key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KeyError {
    /// The operating system gives no random numbers for a new key.
    #[error("the operating system gives no random numbers: {0}")]
    Random(String),
    /// The built-in development key is damaged.
    #[error("the development key is none")]
    Development,
    /// The file of the key cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file holds something else.
    #[error("{}: this is not {wanted}", path.display())]
    NotAKey {
        /// The file.
        path: PathBuf,
        /// What was expected, and where it comes from.
        wanted: &'static str,
    },
}

/// Why a debug probe does not write flash. The text is a sentence: what, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProbeError {
    /// The program that drives debug probes is missing.
    #[error(
        "probe-rs is not installed, which writes flash through a debug probe: cargo install probe-rs-tools --locked, or see \
         https://probe.rs; with a boot loader on the board, 'vergence flash --serial' needs no probe"
    )]
    Missing,
    /// It is there and cannot be run.
    #[error("probe-rs cannot be run: {0}")]
    Unusable(String),
    /// It is too old.
    #[error(
        "the installed probe-rs is {found}, needed is {}.{} or newer: cargo install probe-rs-tools --locked",
        oldest[0], oldest[1]
    )]
    TooOld {
        /// The version that is installed.
        found: String,
        /// The oldest that would do.
        oldest: [u32; 2],
    },
    /// The bytes for flash cannot be handed over.
    #[error("no temporary file can be written: {0}")]
    Temporary(String),
    /// It failed; the text says what went wrong, as far as its words are known.
    #[error("{0}")]
    Failed(String),
}
