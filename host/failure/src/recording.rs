//! Exit codes of errors from recordings.

use vergence_recording::RecordingError;

use crate::Failure;

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Live(error) => error.into(),
            RecordingError::DiskFull(_) => Self::device(error.to_string()),
            _ => Self::usage(error.to_string()),
        }
    }
}
