//! Other people's programs by way of Python scripts, which print JSON.

use std::process::Command;

use serde::de::DeserializeOwned;

/// Runs `script` in `python` and reads its answer; says in words why it cannot.
pub fn ask_python<T: DeserializeOwned>(
    python: &str,
    script: &str,
    arguments: impl IntoIterator<Item = String>,
) -> Result<T, String> {
    let output = Command::new(python)
        .args(["-c", script])
        .args(arguments)
        .output()
        .map_err(|error| format!("{python} does not start: {error}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(said.lines().last().unwrap_or("it fails without a word").to_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|error| format!("its answer is not understood: {error}"))
}
