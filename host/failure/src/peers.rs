//! Rigs on other machines.

use vergence_peers::PeersError;

use crate::Failure;

impl From<PeersError> for Failure {
    fn from(error: PeersError) -> Self {
        let message = error.to_string();
        match error {
            PeersError::BuiltWithout
            | PeersError::Name(_)
            | PeersError::Endpoint(_)
            | PeersError::OtherComputers(_)
            | PeersError::Nowhere
            | PeersError::Secret { .. } => Self::usage(message),
            PeersError::Foreign(_) => Self::protocol(message),
            PeersError::NotReached { .. } => Self::check(message),
            _ => Self::device(message),
        }
    }
}
