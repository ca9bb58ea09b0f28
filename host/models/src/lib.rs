//! Keeps pre-trained matching networks on this machine: store, download, verification, choice of the runtime.
//!
//! The store is a folder with one folder for each model, which holds `model.toml` (the manifest) and the files that the
//! manifest names. Nothing is printed: functions return values, report progress to a callback, and read the clock that
//! the caller passes in.

mod add;
mod choose;
mod error;
mod files;
mod known;
mod pattern;
mod pull;
mod runtime;
mod speed;
mod store;
mod verify;

use std::time::Duration;

pub use add::{Added, add};
pub use choose::{Chosen, ModelName, choose};
pub use error::ModelsError;
pub use known::{KNOWN, Known};
pub use pattern::{Pattern, SMALL_KEYPOINTS};
pub use pull::{Pull, Pulled};
pub use runtime::{Runtime, RuntimeKind, Runtimes, threads};
pub use speed::Speed;
pub use store::{MODEL_FILE, ModelStore, intact, load, read_manifest};
pub use vergence_networks::Processor;
pub use verify::{Verdict, verify};

/// Returns the time since some fixed instant. Libraries read no clock of their own.
pub type Clock = fn() -> Duration;
