//! Real data outside the repository: photographs, corner lists and networks, which may not be redistributed.
//!
//! The folder is the one that `VERGENCE_SHARED` names, or `shared` beside the checkout. A test whose data are missing prints
//! one line, `SKIPPED <test>: <why>`, and passes; with `VERGENCE_REQUIRE_DATA=1` it fails.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::panic, clippy::print_stdout, reason = "a test fails loudly, or says that it was skipped")]
#![allow(clippy::disallowed_methods, reason = "a test looks for its data")]

use std::path::{Path, PathBuf};

/// The folder with real data, whether it exists or not.
fn real_data_root() -> PathBuf {
    std::env::var_os("VERGENCE_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"), PathBuf::from)
}

/// The file or folder `inside` the folder with real data; `None` if it is missing and the calling test is to be skipped.
///
/// # Panics
/// If it is missing and `VERGENCE_REQUIRE_DATA=1`.
pub fn real_data(inside: &str) -> Option<PathBuf> {
    let found = real_data_root().join(inside);
    if found.exists() {
        return Some(found);
    }
    let why = format!("{} is missing; set VERGENCE_SHARED to the folder that has it", found.display());
    skip(&why);
    None
}

/// Skips the calling test, because of what is missing.
///
/// # Panics
/// If `VERGENCE_REQUIRE_DATA=1`.
pub fn skip(why: &str) {
    let required = std::env::var_os("VERGENCE_REQUIRE_DATA").is_some_and(|value| value == "1");
    assert!(!required, "VERGENCE_REQUIRE_DATA=1, but {why}");
    say_skipped(why);
}

/// Prints the line of a skipped test.
pub fn say_skipped(why: &str) {
    let thread = std::thread::current();
    println!("SKIPPED {}: {why}", thread.name().unwrap_or("a test"));
}
