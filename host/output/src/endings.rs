//! Endings of output files: they decide the format, so that an unknown one is refused before anything is written.

use std::path::Path;

use crate::error::OutputError;

/// Checks that the name of `path` has one of the endings `known` (without the dot, in lower case), and which.
///
/// # Errors
/// Names the endings that are known.
pub fn check_ending<'a>(path: &Path, known: &[&'a str]) -> Result<&'a str, OutputError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if let Some(found) = known.iter().copied().find(|known| *known == ending) {
        return Ok(found);
    }
    let known: Vec<_> = known.iter().map(|ending| format!(".{ending}")).collect();
    let path = path.to_owned();
    Err(if ending.is_empty() {
        OutputError::NoEnding { path, known: known.join(" or ") }
    } else {
        OutputError::UnknownEnding { path, ending, known: known.join(" or ") }
    })
}

/// Checks that `path` is meant as a folder: a name with the ending of a file would make a folder of that name.
///
/// # Errors
/// Where the name has the ending of a known file format.
pub fn check_folder(path: &Path) -> Result<(), OutputError> {
    const FILES: [&str; 9] = ["ply", "pcd", "xyz", "las", "e57", "csv", "json", "svg", "png"];
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if path.is_dir() || !FILES.contains(&ending.as_str()) {
        return Ok(());
    }
    Err(OutputError::NotAFolder(path.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_endings_are_refused_with_the_known_ones() {
        assert_eq!(check_ending(Path::new("a/cloud.PLY"), &["ply"]).ok(), Some("ply"));
        for (wrong, said) in [("cloud.pcd", "'.pcd' is not written"), ("cloud", "has no ending")] {
            let refused = check_ending(Path::new(wrong), &["ply", "svg"]).err().map(|error| error.to_string());
            let refused = refused.unwrap_or_default();
            assert!(refused.contains(said) && refused.contains(".ply or .svg"), "{refused}");
        }
        assert!(check_folder(Path::new("clouds")).is_ok() && check_folder(Path::new("clouds.2026")).is_ok());
        assert!(check_folder(Path::new("cloud.ply")).is_err());
    }
}
