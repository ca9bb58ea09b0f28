//! Networks for matching: where they are kept, and how they come into a matcher.
//!
//! The store is a folder with one folder for each model: `model.toml`, its manifest, and the files that it names.

mod choose;
mod known;
mod pattern;
mod runtime;
mod speed;
mod store;

pub use choose::MatcherOptions;
pub use known::{KNOWN, Known, manifest_for};
pub use pattern::{Pattern, SMALL_KEYPOINTS};
pub use runtime::{Runtime, RuntimeOptions, threads};
pub use speed::Speed;
pub use store::{MODEL_FILE, ModelStore, StoreOptions, digest, load, read_manifest};
