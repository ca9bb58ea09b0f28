//! Exit codes of errors from cameras and image files: a bad file is bad input, anything else a device error.

use vergence_camera::CameraError;

use crate::Failure;

impl From<CameraError> for Failure {
    fn from(error: CameraError) -> Self {
        let message = error.to_string();
        match error {
            CameraError::Unreadable { .. }
            | CameraError::NotAnImage { .. }
            | CameraError::Mask { .. }
            | CameraError::Shapes(_)
            | CameraError::Unpaired { .. }
            | CameraError::Size { .. }
            | CameraError::PoseUnknown(_)
            | CameraError::Untimed(_)
            | CameraError::SameTime(_)
            | CameraError::Rates { .. }
            | CameraError::NoImages(_)
            | CameraError::Simulated(_) => Self::usage(message),
            _ => Self::device(message),
        }
    }
}
