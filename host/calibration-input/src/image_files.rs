//! Image files of a camera or of a pair, by name, pattern or folder.

use std::collections::BTreeMap;
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

/// Image files of a pair, paired.
#[derive(Debug, PartialEq)]
pub struct PairedFiles {
    /// Left and right images, in the order of the left ones.
    pub pairs: [Vec<PathBuf>; 2],
    /// Images without a partner.
    pub alone: Vec<PathBuf>,
}

/// Pairs image files by the last number in their names, such as left007.png with right007.png. Where those numbers are
/// missing or repeat, or none is on both sides, the files pair up in their order.
///
/// # Errors
/// Files to be paired in their order that are more on one side.
pub fn paired([left, right]: [Vec<PathBuf>; 2]) -> Result<PairedFiles, InputError> {
    if let (Some(by_left), Some(by_right)) = (by_number(&left), by_number(&right))
        && by_left.keys().any(|number| by_right.contains_key(number))
    {
        let mut pairs = [Vec::new(), Vec::new()];
        let mut alone = Vec::new();
        for (number, file) in &by_left {
            match by_right.get(number) {
                Some(partner) => {
                    pairs[0].push((*file).clone());
                    pairs[1].push((*partner).clone());
                }
                None => alone.push((*file).clone()),
            }
        }
        let unpaired = by_right.iter().filter(|(number, _)| !by_left.contains_key(number));
        alone.extend(unpaired.map(|(_, file)| (*file).clone()));
        return Ok(PairedFiles { pairs, alone });
    }
    match left.len() == right.len() {
        true => Ok(PairedFiles { pairs: [left, right], alone: Vec::new() }),
        false => Err(InputError::Unpaired { left: left.len(), right: right.len() }),
    }
}

/// The files by the last number in their names; `None` where one has no number, or two have the same.
fn by_number(files: &[PathBuf]) -> Option<BTreeMap<u64, &PathBuf>> {
    let mut numbered = BTreeMap::new();
    for file in files {
        let stem = file.file_stem()?.to_string_lossy();
        let number = stem.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty())?.parse().ok()?;
        if numbered.insert(number, file).is_some() {
            return None;
        }
    }
    Some(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn files_pair_by_their_numbers_and_a_gap_shifts_nothing() {
        let left = named(&["left/left0.png", "left/left1.png", "left/left3.png"]);
        let right = named(&["right/right0.png", "right/right2.png", "right/right3.png"]);
        let paired = paired([left, right]).expect("they have numbers");
        assert_eq!(paired.pairs[0], named(&["left/left0.png", "left/left3.png"]));
        assert_eq!(paired.pairs[1], named(&["right/right0.png", "right/right3.png"]));
        assert_eq!(paired.alone, named(&["left/left1.png", "right/right2.png"]));
    }

    #[test]
    fn files_without_common_numbers_pair_in_order() {
        let in_order = |left: &[&str], right: &[&str]| paired([named(left), named(right)]);
        let plain = in_order(&["a.png", "b.png"], &["c.png", "d.png"]).expect("as many");
        assert_eq!((plain.pairs[1].clone(), plain.alone), (named(&["c.png", "d.png"]), Vec::new()));
        // The last number is the camera's.
        let by_camera = in_order(&["1-cam0.png", "2-cam0.png"], &["1-cam1.png", "2-cam1.png"]).expect("as many");
        assert_eq!(by_camera.pairs[0], named(&["1-cam0.png", "2-cam0.png"]));
        assert!(in_order(&["a.png"], &["c.png", "d.png"]).is_err_and(|error| error.to_string().contains("2 right")));
    }
}
