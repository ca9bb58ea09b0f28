//! Why nothing is exported.

use std::path::PathBuf;

use vergence_camera::CameraError;
use vergence_exchange::ExchangeError;
use vergence_files::FileError;
use vergence_recording::RecordingError;
use vergence_vision::{ImageSize, InvalidView, Side};

/// Why nothing is exported. The text is a sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The recording cannot be read, or the bag of views not be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// An image cannot be read.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The format cannot hold a lens.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// No pinhole camera has such a view.
    #[error(transparent)]
    View(#[from] InvalidView),
    /// Who asked for it wants it no more.
    #[error("interrupted: nothing is written to {}; run the command again", .0.display())]
    Interrupted(PathBuf),
    /// The export was not carried to its end.
    #[error("the export failed: {0}")]
    GivenUp(String),
    /// Images come without a rig file.
    #[error("{}: images do not say by which cameras they were taken: name the rig file with --rig", .0.display())]
    NoRig(PathBuf),
    /// No file can hold the rig.
    #[error("the rig file cannot be written: {0}")]
    Unwritable(String),
    /// An image has another size than the camera in the rig file.
    #[error("the {side} images have {} x {} pixels, the {side} camera of the rig file has {} x {}", .image.width, .image.height, .camera.width, .camera.height)]
    Size {
        /// Which camera.
        side: Side,
        /// The size of its images.
        image: ImageSize,
        /// The size in the rig file.
        camera: ImageSize,
    },
    /// Image files have no times.
    #[error(
        "EuRoC and TUM-VI folders name images by their times, which image files do not tell: name a recording, or choose --to pinhole"
    )]
    Timeless,
    /// EuRoC's folder has one view for each camera.
    #[error("an EuRoC folder holds the front view of each camera: leave out --faces, or choose --to pinhole")]
    FrontOnly,
    /// Options of views where none is made.
    #[error("--faces, --field and --size are for pinhole views: a TUM-VI folder holds the images as they are")]
    NoViews,
    /// No exposure was found.
    #[error("{}: it has no exposure that can be exported{skipped}", .recording.display())]
    Nothing {
        /// The recording.
        recording: PathBuf,
        /// Why exposures were left out, in words; empty where there was none.
        skipped: String,
    },
}
