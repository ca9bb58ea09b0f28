//! Why the live loop cannot go on.

use vergence_camera::CameraError;

/// Why the live loop cannot begin or go on. The text is a sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// Neither camera is there when the loop begins.
    #[error("there is no camera: {}\n{}", .0[0], .0[1])]
    NoCamera(Box<[CameraError; 2]>),
    /// An image cannot be decoded.
    #[error(transparent)]
    Image(#[from] CameraError),
    /// A pair cannot be measured whatever its images show.
    #[error("the pair cannot be measured: {0}")]
    Unmeasurable(String),
    /// The thread that measures ended by itself.
    #[error("measuring failed: {0}")]
    Measuring(String),
    /// The link to the board ended, and with it the pulses of the camera trigger.
    #[error("the link to the board ended: nothing more can be measured")]
    LinkEnded,
}
