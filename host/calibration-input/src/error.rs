//! What can go wrong on the way from pictures and files to views of a target.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use vergence_camera::CameraError;
use vergence_files::FileError;
use vergence_rig::AxisPosition;
use vergence_vision::{ImageSize, Side};

/// Why there are no views of a target, or no camera. The text is a sentence: what, where, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file can be read and says something that cannot be used.
    #[error("{}: {problem}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A pattern of image files is malformed, matches nothing, or matches the images of both cameras.
    #[error("'{pattern}': {problem}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A camera or an image file gives no image.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Every image is damaged.
    #[error("none of {images} images can be read{}", in_parentheses(first.as_deref()))]
    Damaged {
        /// Number of images.
        images: usize,
        /// What is wrong with the first.
        first: Option<String>,
    },
    /// No image shows the target.
    #[error("no target in any of {images} images ({first})")]
    NoTarget {
        /// Number of images.
        images: usize,
        /// Why the first gives no view.
        first: String,
    },
    /// Images are not of the size of the camera that took them.
    #[error(
        "the {side} images are {} x {}, but the {side} camera is one of {} x {}: use the images that the camera was \
         calibrated with",
        images.width, images.height, camera.width, camera.height
    )]
    OtherSize {
        /// The camera.
        side: Side,
        /// Size of its images, in pixels.
        images: ImageSize,
        /// Size of the images that its camera file is for, in pixels.
        camera: ImageSize,
    },
    /// A CSV file of two cameras needs the names of both.
    #[error("--cameras needs the names of two cameras in the CSV file")]
    TwoCameras,
    /// A camera cannot be written as TOML.
    #[error("the camera cannot be written: {0}")]
    Untold(String),
    /// Too few views were taken in the images allowed.
    #[error("{heading}: {taken} of {wanted} views in {images} images")]
    TooFewViews {
        /// The stage pose, in words.
        heading: String,
        /// Number of views taken.
        taken: usize,
        /// Number of views wanted.
        wanted: usize,
        /// Number of images of each camera.
        images: u64,
    },
    /// An axis moved while views were taken.
    #[error("axis '{axis}' moved by {moved} while views were taken: it must stand still")]
    Moved {
        /// The axis.
        axis: String,
        /// How far it moved.
        moved: AxisPosition,
    },
    /// Looking through the cameras ended by itself.
    #[error("looking through the cameras failed: {0}")]
    Looking(String),
    /// The set was interrupted; the text says what is kept and how to go on.
    #[error("{0}")]
    Interrupted(String),
}

impl InputError {
    /// `path` was read and cannot be used.
    pub fn wrong(path: &Path, problem: impl Display) -> Self {
        Self::Wrong { path: path.to_owned(), problem: problem.to_string() }
    }
}

fn in_parentheses(text: Option<&str>) -> String {
    text.map(|text| format!(" ({text})")).unwrap_or_default()
}
