//! Exit codes of what cannot be meant: input is bad input, a result does not pass.

use vergence_plausibility::Implausible;

use crate::Failure;

impl From<Implausible> for Failure {
    fn from(found: Implausible) -> Self {
        match found {
            Implausible::Input(message) => Self::usage(message),
            Implausible::Result(message) => Self::check(message),
        }
    }
}
