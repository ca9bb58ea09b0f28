//! Exit codes of errors from exports.

use vergence_export::ExportError;

use crate::Failure;

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Recording(error) => error.into(),
            ExportError::Camera(error) => error.into(),
            ExportError::Interrupted(_) => Self::interrupted(error.to_string()),
            ExportError::GivenUp(_) => Self::device(error.to_string()),
            ExportError::Nothing { .. } => Self::check(error.to_string()),
            _ => Self::usage(error.to_string()),
        }
    }
}
