//! Exit codes of errors from the live loop.

use vergence_live::{KeptPosesError, LiveError};

use super::Failure;

impl From<LiveError> for Failure {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Image(error) => error.into(),
            LiveError::LinkEnded => Self::link(error.to_string()),
            _ => Self::device(error.to_string()),
        }
    }
}

impl From<KeptPosesError> for Failure {
    fn from(error: KeptPosesError) -> Self {
        match error {
            KeptPosesError::File(error) => error.into(),
            _ => Self::usage(error.to_string()),
        }
    }
}
