//! Exit codes of errors from the simulated rig.

use vergence_sim::SimError;

use crate::Failure;

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        let message = error.to_string();
        match error {
            SimError::Stopped(_) => Self::check(message),
            _ => Self::usage(message),
        }
    }
}
