//! The firmware's ELF files.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Builds a package of the firmware as `docs/firmware.md` says; returns its ELF file.
pub fn build(package: &str) -> PathBuf {
    build_in("firmware", package, None, None)
}

/// Builds the application for another number of axes; returns its ELF file, which has the name of the feature.
pub fn build_wired(feature: &str) -> PathBuf {
    build_in("firmware", "vergence-nucleo-g474", None, Some(feature))
}

/// Builds it to trust the key of this line, as `docs/flashing.md` says; returns its ELF file.
pub fn build_trusting(package: &str, line: &str) -> PathBuf {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own.key.pub");
    std::fs::write(&file, line).expect("the folder is ours");
    build_in("firmware-own-key", package, Some(&file), None)
}

/// Each build takes the place of the one before, also of another test program's: one after the other, they are kept under names of their own.
fn build_in(folder: &str, package: &str, key: Option<&Path>, feature: Option<&str>) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    std::fs::create_dir_all(&target).expect("the folder is ours");
    let turn = File::create(target.join("turn")).expect("the folder is ours");
    turn.lock().expect("files can be locked");
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "--locked", "-p", package, "--target-dir"])
        .arg(&target)
        .args(feature.iter().flat_map(|feature| ["--features", feature]))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/nucleo-g474"))
        .env("VERGENCE_PUBLIC_KEY", key.unwrap_or(Path::new("")))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Whole or not at all: others may be reading it.
    let (kept, copy) = (target.join(feature.unwrap_or(package)), target.join("copy"));
    std::fs::copy(target.join("thumbv7em-none-eabihf/release").join(package), &copy).expect("the folder is ours");
    std::fs::rename(copy, &kept).expect("the folder is ours");
    kept
}
