//! Exit codes of errors from the live loop.

use vergence_live::LiveError;

use crate::Failure;

impl From<LiveError> for Failure {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Image(error) => error.into(),
            LiveError::LinkEnded => Self::link(error.to_string()),
            _ => Self::device(error.to_string()),
        }
    }
}
