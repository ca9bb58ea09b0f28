//! Failures of the model store.

use vergence_models::ModelsError;

use crate::Failure;

impl From<ModelsError> for Failure {
    fn from(error: ModelsError) -> Self {
        let message = error.to_string();
        match error {
            ModelsError::Digest { .. }
            | ModelsError::DownloadDigest { .. }
            | ModelsError::Run(_)
            | ModelsError::Mismatch { .. }
            | ModelsError::Record(_) => Self::check(message),
            _ => Self::usage(message),
        }
    }
}
