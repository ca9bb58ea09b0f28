//! Python scripts of peers, which print JSON.

use std::process::Command;

use serde::de::DeserializeOwned;

/// Runs `script` with `arguments` in the interpreter `python` and reads its answer as JSON.
///
/// # Errors
/// A sentence that says why there is no answer, and which module to install where one is missing.
pub fn ask_python<T: DeserializeOwned>(
    python: &str,
    script: &str,
    arguments: impl IntoIterator<Item = String>,
) -> Result<T, String> {
    let output = Command::new(python)
        .args(["-c", script])
        .args(arguments)
        .output()
        .map_err(|error| format!("{python} does not start ({error})"))?;
    if !output.status.success() {
        return Err(reason(python, &String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| format!("the answer of {python} is not understood: {error}"))
}

/// Why Python failed, from the end of what it wrote to standard error.
fn reason(python: &str, stderr: &str) -> String {
    let last = stderr.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it failed without a message");
    let missing =
        last.strip_prefix("ModuleNotFoundError: No module named '").and_then(|rest| rest.split(['\'', '.']).next());
    match missing {
        Some(module) => {
            let package = if module == "cv2" { "opencv-python-headless" } else { module };
            format!("{python} has no module {module}: install it with '{python} -m pip install {package}'")
        }
        None => format!("{python} failed: {last}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_module_is_a_sentence_that_says_what_to_install() {
        let said = "Traceback (most recent call last):\n  File \"<string>\", line 3\nModuleNotFoundError: No module named 'cv2'\n";
        assert_eq!(
            reason("python3", said),
            "python3 has no module cv2: install it with 'python3 -m pip install opencv-python-headless'"
        );
        assert_eq!(reason("python3", "ValueError: no\n\n"), "python3 failed: ValueError: no");
        assert_eq!(reason("python3", ""), "python3 failed: it failed without a message");
    }
}
