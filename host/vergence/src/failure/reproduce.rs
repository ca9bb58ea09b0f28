//! Failures of the paper's experiments.

use vergence_reproduce::ReproduceError;

use super::Failure;

impl From<ReproduceError> for Failure {
    fn from(error: ReproduceError) -> Self {
        Self::check(error.to_string())
    }
}
