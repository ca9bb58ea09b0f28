//! Image files of a camera by name, pattern or folder.

use std::fmt;
use std::path::{Path, PathBuf};

use vergence_camera::image_files;

use crate::InputError;

/// Image files by name: files, patterns such as `left*.jpg`, and folders, whose JPEG and PNG images are taken. Each is
/// sorted by name, with numbers as numbers.
///
/// # Errors
/// A pattern that is malformed, or that matches nothing; a folder without images, or with those of two cameras.
pub fn named_images(patterns: &[String]) -> Result<Vec<PathBuf>, InputError> {
    let mut files = Vec::new();
    for pattern in patterns {
        let fail =
            |problem: &dyn fmt::Display| InputError::Pattern { pattern: pattern.clone(), problem: problem.to_string() };
        let mut named = Vec::new();
        if Path::new(pattern).is_dir() {
            named = image_files(pattern.as_ref())?;
            let is_of = |side: &str| named.iter().any(|file| name_of(file).starts_with(side));
            if is_of("left") && is_of("right") {
                return Err(fail(&"it holds images of both cameras: name those of one, such as 'DIR/left*'"));
            }
        } else {
            for file in glob::glob(pattern).map_err(|error| fail(&error))? {
                named.push(file.map_err(|error| fail(&error))?);
            }
        }
        if named.is_empty() {
            return Err(fail(&"no such file"));
        }
        named.sort_by_key(|file| natural_order(&file.to_string_lossy()));
        files.append(&mut named);
    }
    Ok(files)
}

pub(crate) fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Numbers in names count as numbers: left2 before left10.
fn natural_order(name: &str) -> Vec<(String, u64)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (text, tail) = rest.split_at(digits);
        let end = tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len());
        let (number, tail) = tail.split_at(end);
        parts.push((text.to_owned(), number.parse().unwrap_or(0)));
        rest = tail;
    }
    parts
}
