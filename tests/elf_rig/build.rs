//! The firmware's ELF files.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Builds a package of the firmware as `docs/firmware.md` says; returns its ELF file.
pub fn build(package: &str) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware");
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "--locked", "-p", package, "--target-dir"])
        .arg(&target)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/nucleo-g474"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    target.join("thumbv7em-none-eabihf/release").join(package)
}
