//! The firmware's ELF files.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// Builds a package of the firmware as `docs/firmware.md` says; returns its ELF file.
pub fn build(package: &str) -> PathBuf {
    build_in("firmware", package, None, &[])
}

/// Builds the application for another number of axes; returns its ELF file, which has the name of the feature.
pub fn build_wired(feature: &str) -> PathBuf {
    // One after the other: each takes the place of the one before.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock();
    let built = build_in("firmware", "vergence-nucleo-g474", None, &["--features", feature]);
    let kept = built.with_file_name(feature);
    std::fs::copy(built, &kept).expect("the folder is ours");
    kept
}

/// Builds it to trust the key of this line, as `docs/flashing.md` says; returns its ELF file.
pub fn build_trusting(package: &str, line: &str) -> PathBuf {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own.key.pub");
    std::fs::write(&file, line).expect("the folder is ours");
    build_in("firmware-own-key", package, Some(&file), &[])
}

fn build_in(folder: &str, package: &str, key: Option<&Path>, more: &[&str]) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "--locked", "-p", package, "--target-dir"])
        .arg(&target)
        .args(more)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/nucleo-g474"))
        .env("VERGENCE_PUBLIC_KEY", key.unwrap_or(Path::new("")))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    target.join("thumbv7em-none-eabihf/release").join(package)
}
