//! Exit codes of calibrations that must not be used, and of cameras that cannot be compared.

use vergence_calibration::{LensDifferenceError, Unfit};
use vergence_targets::ImplausibleTarget;

use crate::Failure;

impl From<Unfit> for Failure {
    fn from(unfit: Unfit) -> Self {
        Self::check(unfit.to_string())
    }
}

impl From<LensDifferenceError> for Failure {
    fn from(error: LensDifferenceError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<ImplausibleTarget> for Failure {
    fn from(error: ImplausibleTarget) -> Self {
        Self::usage(error.to_string())
    }
}
