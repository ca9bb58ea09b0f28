//! Why a file of another program is refused.

use vergence_vision::{InvalidLens, NoFit};

use crate::Format;

/// Why a file of another program, or a choice among its cameras, is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExchangeError {
    /// The format is known by name only.
    #[error("this is {what}, which is not read: {advice}")]
    Unread {
        /// What the file is.
        what: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// The format is not known.
    #[error(
        "this is no camera file of a known format: OpenCV, Kalibr, Basalt, EuRoC, ROS, mrcal, COLMAP, ORB-SLAM, OCamCalib and \
         librealsense are read"
    )]
    Unknown,
    /// The file is not what its format asks for.
    #[error("this is {format}: {problem}")]
    Wrong {
        /// The format.
        format: Format,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// The parameters describe no camera.
    #[error("this is {format}, but its {camera} is no camera: {lens}")]
    Lens {
        /// The format.
        format: Format,
        /// Name of the camera.
        camera: String,
        /// Why.
        lens: InvalidLens,
    },
    /// No lens of this program comes near the camera.
    #[error("camera {camera}: {fit}")]
    Fit {
        /// Name of the camera.
        camera: String,
        /// Why.
        fit: NoFit,
    },
    /// The file has no camera of this name.
    #[error("there is no camera '{name}': the file has {}", names.join(", "))]
    NoCamera {
        /// The name that was asked for.
        name: String,
        /// The names that there are.
        names: Vec<String>,
    },
    /// One camera is needed, and the file has several.
    #[error("the file has {} cameras: choose one, as in FILE#{}", names.len(), names.join(" or FILE#"))]
    Several {
        /// The names that there are.
        names: Vec<String>,
    },
    /// Two cameras are needed, and the file has another number of them.
    #[error("a pair has two cameras, and the file has {}: {}", names.len(), names.join(", "))]
    NotTwo {
        /// The names that there are.
        names: Vec<String>,
    },
    /// The file does not say where a camera is.
    #[error("the file does not say where camera {camera} is relative to the other one")]
    NoPose {
        /// Name of the camera.
        camera: String,
    },
}
