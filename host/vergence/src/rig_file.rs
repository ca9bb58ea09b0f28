//! The rig that a command works with: a file, or the built-in bench.

use std::path::Path;

use vergence_rig::{BENCH_TOML, Rig};

use crate::failure::Failure;

/// Reads and checks the rig file at `path`; without one, the bench.
///
/// # Errors
/// Says which file and what is wrong with it.
pub fn load(path: Option<&Path>) -> Result<Rig, Failure> {
    let Some(path) = path else {
        return Rig::from_toml(BENCH_TOML).map_err(|error| Failure::usage(format!("the built-in rig: {error}")));
    };
    let text = std::fs::read_to_string(path).map_err(|error| Failure::input(path, error))?;
    Rig::from_toml(&text).map_err(|error| Failure::input(path, error))
}
