//! Failures of the paper's experiments and of the demonstration.

use vergence_reproduce::{DemoError, ReproduceError};

use crate::Failure;

impl From<ReproduceError> for Failure {
    fn from(error: ReproduceError) -> Self {
        let message = error.to_string();
        match error {
            ReproduceError::Sim(error) => error.into(),
            ReproduceError::Board(error) => error.into(),
            _ => Self::check(message),
        }
    }
}

impl From<DemoError> for Failure {
    fn from(error: DemoError) -> Self {
        let message = error.to_string();
        match error {
            DemoError::Board(error) => error.into(),
            DemoError::Sim(error) => error.into(),
            DemoError::Zones(_) => Self::check(message),
            _ => Self::device(message),
        }
    }
}
