//! The rig that a command works with: a file, or the built-in bench.

use std::path::Path;

use vergence_rig::{BENCH_TOML, Rig};

use crate::failure::Failure;

/// Reads and checks the rig file at `path`; without one, the bench.
///
/// # Errors
/// Says which file and what is wrong with it.
pub fn load(path: Option<&Path>) -> Result<Rig, Failure> {
    let Some(path) = path else { return bench() };
    let text = std::fs::read_to_string(path).map_err(|error| Failure::input(path, error))?;
    let rig = Rig::from_toml(&text).map_err(|error| Failure::input(path, error))?;
    // Whole names, so that they stay right in the files that calibrations write elsewhere.
    let whole = std::path::absolute(path).map_err(|error| Failure::input(path, error))?;
    Ok(rig.with_masks_from(whole.parent().unwrap_or(&whole)))
}

/// The built-in bench with sensors of the same size that have `width` pixels across.
///
/// # Errors
/// Where `width` leaves no pixels.
pub fn bench_with_sensors(width: u32) -> Result<Rig, Failure> {
    let rig = bench()?.with_sensors(width);
    rig.map_err(|error| Failure::usage(format!("sensors of {width} pixels: {error}")))
}

fn bench() -> Result<Rig, Failure> {
    Rig::from_toml(BENCH_TOML).map_err(|error| Failure::usage(format!("the built-in rig: {error}")))
}
