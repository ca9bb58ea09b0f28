//! Exit codes of errors from files: one that cannot be read or written is bad input.

use vergence_files::FileError;

use crate::Failure;

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Self::usage(error.to_string())
    }
}
