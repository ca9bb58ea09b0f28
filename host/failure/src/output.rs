//! Exit codes of errors from drawing and writing: a file that cannot be written is bad input.

use vergence_output::{CloudError, OutputError};

use crate::Failure;

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<CloudError> for Failure {
    fn from(error: CloudError) -> Self {
        Self::usage(error.to_string())
    }
}
