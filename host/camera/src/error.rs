//! Errors of cameras and image files.

use std::path::PathBuf;

use vergence_rig::MaskError;
use vergence_vision::{ImageSize, Side};

/// Why a camera or an image file gives no image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A file or folder cannot be read.
    #[error("{}: {why}", path.display())]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        why: String,
    },
    /// A file is not a whole JPEG or PNG image.
    #[error("{}: not a readable image: {why}", path.display())]
    NotAnImage {
        /// The file.
        path: PathBuf,
        /// The reason why the contents are refused.
        why: String,
    },
    /// A file is no mask of its camera.
    #[error("{}: {why}", path.display())]
    Mask {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Shapes of a rig file are no mask of a camera's images.
    #[error("the mask in the rig file: {0}")]
    Shapes(MaskError),
    /// Nothing says which images of both cameras were taken together.
    #[error(
        "nothing says which of {} left and {} right images belong together ({} and {} are the first): they must pair up by \
         name, number or time stamp, such as left000.png and right000.png",
        counts[0], counts[1], first[0].display(), first[1].display()
    )]
    Unpaired {
        /// The first image of the left camera and of the right one.
        first: [PathBuf; 2],
        /// Number of images of each.
        counts: [usize; 2],
    },
    /// An image is not of the size of its camera.
    #[error(
        "{side} image '{name}' is {} x {}, but the {side} camera of the rig file is {} x {}: use the images the camera was \
         calibrated with, or its rig file",
        size.width, size.height, wanted.width, wanted.height
    )]
    Size {
        /// The camera.
        side: Side,
        /// Name of the image.
        name: String,
        /// Size of the image.
        size: ImageSize,
        /// Size of the images of the camera.
        wanted: ImageSize,
    },
    /// Images of files cannot be measured by a rig with axes.
    #[error(
        "images of files were not taken where the axes of rig '{0}' stand now, and nothing says where they stood: name the rig file of a pair without \
         axes (--rig), 'vergence replay' a recording, which holds the encoders, or measure one pair by 'vergence depth --mode'"
    )]
    PoseUnknown(String),
    /// The names of image files do not tell when they were taken.
    #[error(
        "{}: its name tells no time: name images by time stamp or by number, such as 1403636579763555584.png or left000.png",
        .0.display()
    )]
    Untimed(PathBuf),
    /// Two images of one camera have the same time in their names.
    #[error("{} and {} have the same time or number in their names: name each image of a camera differently", .0[0].display(), .0[1].display())]
    SameTime([PathBuf; 2]),
    /// The videos of both cameras have different rates.
    #[error(
        "{} has {} images a second, and {} has {}: record both at one rate, or bring them to one by 'ffmpeg -r'",
        paths[0].display(), rates[0], paths[1].display(), rates[1]
    )]
    Rates {
        /// The video of the left camera and that of the right one.
        paths: [PathBuf; 2],
        /// Images per second of each.
        rates: [String; 2],
    },
    /// A folder holds no image.
    #[error("{}: no JPEG or PNG image in this folder", .0.display())]
    NoImages(PathBuf),
    /// A camera cannot be opened or set up.
    #[error("camera {}: {why}; is it attached, and free of other programs?", device.display())]
    Unavailable {
        /// Device file of the camera.
        device: PathBuf,
        /// The operating system's reason.
        why: String,
    },
    /// A camera offers no pixel format that is understood at the size that was asked for.
    #[error("camera {} offers none of GREY, YUYV, MJPG at {width} x {height}: choose another --size", device.display())]
    NoFormat {
        /// Device file of the camera.
        device: PathBuf,
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
    /// A camera sends one damaged image after the other.
    #[error("camera {} sends only damaged images: check its cable", .0.display())]
    Damaged(PathBuf),
    /// A camera that was open stopped sending.
    #[error("camera {} vanished: {why}; images taken before are kept", device.display())]
    Vanished {
        /// Device file of the camera.
        device: PathBuf,
        /// The operating system's reason.
        why: String,
    },
    /// A camera has no more images.
    #[error("a camera has no more images")]
    Ended,
    /// Two cameras never exposed at the same time.
    #[error("in {images} images the two cameras never exposed at the same time: check that both run at the same rate")]
    OutOfStep {
        /// Number of images taken with each camera.
        images: usize,
    },
    /// A simulated camera has nothing to show.
    #[error("{0}")]
    Simulated(String),
}
