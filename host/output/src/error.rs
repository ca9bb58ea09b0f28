//! Why nothing can be written.

use std::path::PathBuf;

use vergence_files::FileError;

use crate::points::CloudError;
use crate::target_sheet::Paper;

/// Why an output file cannot be written. The text is a sentence: which file, why, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// A file or folder cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A cloud cannot be written so.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// The ending of a file's name says a format that is not written there.
    #[error("{}: '.{ending}' is not written: choose a name that ends in {known}", path.display())]
    UnknownEnding {
        /// The file.
        path: PathBuf,
        /// Its ending, without the dot.
        ending: String,
        /// The endings that are known.
        known: String,
    },
    /// A file's name has no ending that would say the format.
    #[error("{}: has no ending: choose a name that ends in {known}", path.display())]
    NoEnding {
        /// The file.
        path: PathBuf,
        /// The endings that are known.
        known: String,
    },
    /// The name of a folder has the ending of a file.
    #[error("{}: a folder is written here, not a file: choose a name without an ending", .0.display())]
    NotAFolder(PathBuf),
    /// A target does not fit on its sheet.
    #[error(
        "{target} need {:.0} x {:.0} mm with their border, and {paper} has {:.0} x {:.0} mm: choose a smaller target or a \
         larger sheet",
        needed.0, needed.1, size.0, size.1
    )]
    SmallSheet {
        /// The target.
        target: String,
        /// Width and height that the target needs with its border, in millimetres.
        needed: (f64, f64),
        /// The sheet.
        paper: Paper,
        /// Its width and height, in millimetres.
        size: (f64, f64),
    },
}
