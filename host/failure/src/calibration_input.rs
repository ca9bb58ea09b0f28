//! Exit codes of errors from views of targets, and from the store of calibrations.

use vergence_calibration_input::{InputError, StoreError};

use crate::Failure;

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        let message = error.to_string();
        match error {
            InputError::Camera(error) => error.into(),
            InputError::Untold(_) => Self::check(message),
            InputError::TooFewViews { .. } | InputError::Moved { .. } | InputError::Looking(_) => Self::device(message),
            InputError::Interrupted(_) => Self::interrupted(message),
            _ => Self::usage(message),
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        Self::usage(error.to_string())
    }
}
