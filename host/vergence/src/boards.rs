//! Boards in image files.

use std::path::PathBuf;

use image::imageops::grayscale;
use rayon::prelude::*;
use vergence_calibration::detect::{DetectError, detect};
use vergence_calibration::{BoardSpec, BoardView};
use vergence_vision::{ImageSize, KannalaBrandt};

use crate::camera::read_image;
use crate::failure::Failure;

/// What images show of a board.
pub struct Boards {
    /// The size that all images have.
    pub size: ImageSize,
    /// One for each image, in their order: the view, or why there is none.
    pub views: Vec<Result<BoardView, (String, DetectError)>>,
}

impl Boards {
    /// The views in which a board was found.
    #[must_use]
    pub fn found(&self) -> Vec<BoardView> {
        self.views.iter().flatten().cloned().collect()
    }

    /// These views, and those of `other`, of the same images, where there is none.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let views = self.views.into_iter().zip(other.views).map(|(own, other)| own.or(other)).collect();
        Self { views, ..self }
    }

    /// The images without one, and why.
    pub fn missed(&self) -> impl Iterator<Item = &(String, DetectError)> {
        self.views.iter().filter_map(|view| view.as_ref().err())
    }
}

/// The files that patterns such as `left*.jpg` name, in the order of their names; a file may also be named itself.
///
/// # Errors
/// A pattern that is none, or that names nothing.
pub fn files(patterns: &[String]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for pattern in patterns {
        let fail = |problem: &dyn std::fmt::Display| Failure::usage(format!("'{pattern}': {problem}"));
        let mut named = Vec::new();
        for file in glob::glob(pattern).map_err(|error| fail(&error))? {
            named.push(file.map_err(|error| fail(&error))?);
        }
        if named.is_empty() {
            return Err(fail(&"no such file"));
        }
        named.sort_by_key(|file| natural_order(&file.to_string_lossy()));
        files.append(&mut named);
    }
    Ok(files)
}

/// Numbers in names count as numbers: left2 before left10, so that left and right images pair up.
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

/// Looks for the board in every image. With a `hint`, a camera that is roughly right, more corners are found, and better.
///
/// # Errors
/// An image that cannot be read, or images of different sizes.
pub fn detect_in(files: &[PathBuf], board: &BoardSpec, hint: Option<&KannalaBrandt>) -> Result<Boards, Failure> {
    let looked: Vec<_> = files
        .par_iter()
        .map(|path| {
            let image = read_image(path)?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let found = detect(&grayscale(&image), board, hint);
            let view = match found {
                Ok(detection) => Ok(detection.view(&name, board)),
                Err(reason) => Err((name, reason)),
            };
            Ok((image.dimensions(), view))
        })
        .collect::<Result<_, Failure>>()?;
    let Some(&((width, height), _)) = looked.first() else { return Err(Failure::usage("there are no images")) };
    for (path, (other, _)) in files.iter().zip(&looked) {
        if *other != (width, height) {
            return Err(Failure::input(
                path,
                format!(
                    "it is {} x {} and the images before are {width} x {height}: calibrate one size at a time",
                    other.0, other.1
                ),
            ));
        }
    }
    let views = looked.into_iter().map(|(_, view)| view).collect();
    Ok(Boards { size: ImageSize { width, height }, views })
}
