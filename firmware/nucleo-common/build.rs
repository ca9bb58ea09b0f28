//! Takes the trusted key from the file that `VERGENCE_PUBLIC_KEY` names; without it the development key is trusted.

use std::path::{Path, PathBuf};
use std::{env, fs};

const VARIABLE: &str = "VERGENCE_PUBLIC_KEY";

fn main() -> Result<(), String> {
    println!("cargo::rerun-if-env-changed={VARIABLE}");
    println!("cargo::rerun-if-changed=build.rs");
    let key = match env::var_os(VARIABLE).filter(|name| !name.is_empty()) {
        Some(name) => format!("{:?}", read(&PathBuf::from(name))?),
        None => "vergence_image::DEVELOPMENT_KEY".to_owned(),
    };
    let source = format!("#[used]\nstatic TRUSTED_KEY: [u8; 32] = {key};\n");
    let out = env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?;
    fs::write(Path::new(&out).join("key.rs"), source).map_err(|error| error.to_string())
}

/// The key in a file that `vergence image keygen` wrote.
fn read(path: &Path) -> Result<[u8; 32], String> {
    let fail = |why: &str| format!("{VARIABLE}: {}: {why}", path.display());
    if path.is_relative() {
        return Err(fail("name the file by its whole path, from / on"));
    }
    println!("cargo::rerun-if-changed={}", path.display());
    let text = fs::read_to_string(path).map_err(|error| fail(&error.to_string()))?;
    let wanted = || fail("this is no public key, which 'vergence image keygen' writes to a .pub file");
    let digits = text.trim().strip_prefix("vergence-public-key").ok_or_else(wanted)?.trim();
    if digits.len() != 64 || !digits.is_ascii() {
        return Err(wanted());
    }
    let mut key = [0; 32];
    for (index, byte) in key.iter_mut().enumerate() {
        *byte = u8::from_str_radix(&digits[2 * index..2 * index + 2], 16).map_err(|_| wanted())?;
    }
    Ok(key)
}
