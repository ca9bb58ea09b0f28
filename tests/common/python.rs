//! The Python interpreter with other projects' libraries, against which ours is tested.

use std::process::Command;

use super::data::skip;

/// The interpreter, `python3` or that of `VERGENCE_PYTHON`, if this `import` statement works in it; else the test is skipped, or fails where data are required.
/// `packages` are what pip must install for it.
pub fn python(import: &str, packages: &str) -> Option<String> {
    let python = std::env::var("VERGENCE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let asked = Command::new(&python).args(["-c", import]).output();
    if asked.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    let why = format!("{python} cannot run '{import}': install it with '{python} -m pip install {packages}'");
    skip(&why);
    None
}
