//! Failures of measurements beside other programs.

use vergence_bench::BenchError;

use crate::Failure;

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        let message = error.to_string();
        match error {
            BenchError::Models(error) => error.into(),
            BenchError::Sim(error) => error.into(),
            BenchError::Threads(_) => Self::device(message),
            BenchError::Qemu(_) | BenchError::Chip(_) | BenchError::Work(_) => Self::check(message),
            _ => Self::usage(message),
        }
    }
}
