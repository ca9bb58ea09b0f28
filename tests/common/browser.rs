//! The real browser that looks at pages: Chromium (`VERGENCE_CHROMIUM`, or `chromium` in the path), node, and what `npm ci` fetches in `tests/panel`.

use std::path::{Path, PathBuf};

use super::data::skip;

/// The folder where pictures are kept.
pub fn pictures() -> PathBuf {
    let pictures = Path::new(env!("CARGO_TARGET_TMPDIR")).join("panel");
    std::fs::create_dir_all(&pictures).expect("a folder");
    pictures
}

/// The browser and the folder with the scripts, if everything is there; else the test is skipped, or fails where data are required.
pub fn browser() -> Option<(String, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/panel");
    let chromium = std::env::var("VERGENCE_CHROMIUM").unwrap_or_else(|_| "chromium".to_owned());
    let path = std::env::var_os("PATH").unwrap_or_default();
    let program = |name: &str| std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.exists());
    let why = match (program(&chromium), program("node"), folder.join("node_modules/playwright-core").exists()) {
        (None, ..) => format!("there is no {chromium}: install Chromium, or name it by VERGENCE_CHROMIUM"),
        (_, None, _) => "there is no node: install Node.js".to_owned(),
        (.., false) => "tests/panel lacks its packages: run 'npm ci' there".to_owned(),
        (Some(chromium), ..) => return Some((chromium.display().to_string(), folder)),
    };
    skip(&why);
    None
}
